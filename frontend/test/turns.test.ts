import { describe, expect, it } from "vitest";
import { CALM_MS, FRAME_MS, PATIENCE_MS, Turns, type Screen } from "../src/core/turns";

/** Frames of 16 ms by hand. */
class Frames implements Screen {
  time = 1000;
  isBusy = false;
  private frames: (() => void)[] = [];
  private timers = new Set<{ at: number; act: () => void }>();
  now = () => this.time;
  frame = (draw: () => void) => void this.frames.push(draw);
  later = (act: () => void, ms: number) => {
    const timer = { at: this.time + ms, act };
    this.timers.add(timer);
    return timer;
  };
  forget = (timer: unknown) => void this.timers.delete(timer as { at: number; act: () => void });
  busy = (is: boolean) => void (this.isBusy = is);

  next(): void {
    this.time += 16;
    for (const draw of this.frames.splice(0)) draw();
    this.wait(0);
  }

  wait(ms: number): void {
    this.time += ms;
    for (const timer of [...this.timers]) {
      if (timer.at > this.time) continue;
      this.timers.delete(timer);
      timer.act();
    }
  }
}

function panes(costs: readonly number[]) {
  const screen = new Frames();
  const turns = new Turns(0, screen);
  const drawn: number[][] = costs.map(() => []);
  costs.forEach((cost, i) => turns.join({ draw: (moment) => { drawn[i]!.push(moment); screen.time += cost; } }));
  return { screen, turns, drawn };
}

describe("panes", () => {
  it("all show a moment at once that somebody goes to", () => {
    const { screen, turns, drawn } = panes([20, 20, 20]);
    turns.show(1);
    screen.wait(CALM_MS);
    turns.show(2);
    expect(drawn).toEqual([[1, 2], [1, 2], [1, 2]]);
    expect(screen.isBusy).toBe(false);
  });

  it("take turns while somebody scrubs, the one that waited longest first, and all get there", () => {
    const { screen, turns, drawn } = panes([FRAME_MS, FRAME_MS, FRAME_MS]);
    for (const moment of [1, 2, 3, 4, 5]) {
      turns.show(moment);
      screen.next();
    }
    expect(drawn).toEqual([[1, 2, 5], [1, 3], [1, 4]]);
    expect(screen.isBusy).toBe(true);
    screen.next();
    screen.next();
    expect(drawn.map((moments) => moments.at(-1))).toEqual([5, 5, 5]);
    expect(screen.isBusy).toBe(false);
  });

  it("that are quick share a frame", () => {
    const { screen, turns, drawn } = panes([1, 1, 1]);
    turns.show(1);
    turns.show(2);
    screen.next();
    expect(drawn).toEqual([[1, 2], [1, 2], [1, 2]]);
  });
});

describe("what can wait", () => {
  it("is done at once while nothing moves, and when all is calm if something does", () => {
    const { screen, turns } = panes([1]);
    const done: string[] = [];
    turns.whenCalm(() => done.push("still"));
    turns.show(1);
    turns.show(2);
    turns.whenCalm(() => done.push("moving"));
    turns.whenCalm(() => done.push("called off"))();
    expect(done).toEqual(["still"]);
    screen.wait(CALM_MS);
    expect(done).toEqual(["still", "moving"]);
  });

  it("does not wait for ever", () => {
    const { screen, turns } = panes([1]);
    const done: number[] = [];
    for (let moment = 1; moment * 16 < 3 * PATIENCE_MS; moment++) {
      turns.show(moment);
      turns.whenCalm(() => done.push(moment));
      screen.next();
    }
    expect(done.length).toBeGreaterThan(1);
  });
});
