/** What the panes share: the records, the moment they show, whether it moves, what is selected. */

import { useSyncExternalStore } from "react";
import { History, type Mark } from "./core/history";
import { beginning, type Moment } from "./core/moment";
import { connect, type Hello, type Status } from "./link/socket";
import { turns } from "./turn";

export type Selection =
  | { readonly kind: "state"; readonly path: string }
  | { readonly kind: "step"; readonly plan: number; readonly step: number }
  | { readonly kind: "plan"; readonly plan: number }
  | { readonly kind: "record"; readonly seq: number }
  | { readonly kind: "thing"; readonly id: string };

export interface Shown {
  readonly moment: Moment;
  readonly last: number;
  readonly playing: boolean;
  readonly speed: number;
  /** Whether it goes on with a live run. */
  readonly following: boolean;
  readonly live: boolean;
  readonly control: boolean;
  readonly connected: boolean;
  readonly paused: string | null;
  readonly header: Readonly<Record<string, unknown>>;
  /** Why what the program says cannot be shown as it is. */
  readonly wrong: string | null;
  readonly expected: number;
  readonly selection: Selection | null;
}

export const SPEEDS = [1, 2, 5, 10, 30, 100];

const LOADING_MS = 250;
/** Somebody stays at a moment who is there so long: it is in the address then. */
const NOTED_MS = 300;

export class Session {
  readonly history = new History(() => this.later()); // what shows the record is being drawn just now
  private shown: Shown = {
    moment: beginning(), last: 0, playing: false, speed: 10, following: false, live: false, control: false,
    connected: false, paused: null, header: {}, wrong: null, expected: 0, selection: null,
  };
  private readonly listeners = new Set<() => void>();
  private drawing = 0;
  private before = 0;
  private drawn = 0;
  private clock = 0;
  private wanted: number | null = null;
  /** Whether a recorded run is still being opened, at its end. */
  private opening = false;
  private noted = 0;

  constructor() {
    const asked = Number(location.hash.slice(1));
    this.wanted = Number.isInteger(asked) && asked > 0 ? asked : null;
  }

  start(): void {
    connect({
      wanted: () => this.history.last + 1,
      hello: (said: Hello) => {
        const following = said.live && this.wanted === null && (this.history.last === 0 || this.shown.following);
        this.opening ||= !said.live && this.wanted === null && this.history.last === 0;
        this.set({ header: said.header, wrong: strange(said), live: said.live, control: said.control, expected: said.last, connected: true, following });
      },
      status: (said: Status) => {
        const resumed = said.live && !this.shown.live && this.shown.moment.seq === this.history.last;
        this.set({ live: said.live, paused: said.paused, expected: said.last, ...(resumed && { following: true }) });
      },
      records: (from, records) => {
        this.history.append(from, records);
        if (!this.waits()) this.later();
      },
      lost: () => this.set({ connected: false }),
      wrong: (why) => this.set({ wrong: `The program said something that the page cannot read: ${why}` }),
    });
  }

  subscribe = (listener: () => void): (() => void) => {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  };

  get = (): Shown => this.shown;

  /** Show the moment after a record; a live run is then no longer followed, unless it is the last. */
  goTo(seq: number, select?: Selection): void {
    const wanted = Math.max(0, Math.min(seq, this.history.last));
    const moment = this.history.at(wanted);
    this.clock = moment.t;
    this.opening = false;
    this.set({ moment, following: this.shown.live && wanted === this.history.last, playing: false, ...(select && { selection: select }) });
    clearTimeout(this.noted); // browsers refuse to be told of each place that somebody scrubs over
    this.noted = window.setTimeout(() => history.replaceState(null, "", `#${wanted}`), NOTED_MS);
  }

  get kind(): Kind {
    const { marks } = this.history;
    if (this.shown.header.store === true) return "store";
    return marks.scene.length || marks.plan.length || marks.decision.length || this.history.last === 0 ? "run" : "chart";
  }

  /** To the next mark, or the one before; returns whether there is one. */
  jump(mark: Mark, way: 1 | -1): boolean {
    const found = this.history.beside(this.shown.moment.seq, mark, way);
    if (found === undefined) return false;
    this.goTo(found, mark === "step" || this.kind === "store" ? undefined : { kind: "record", seq: found });
    return true;
  }

  step(way: 1 | -1): void {
    if (!this.jump(this.kind === "store" ? "knowledge" : "step", way)) this.goTo(way > 0 ? this.history.last : 0);
  }

  play(playing: boolean): void {
    if (playing && this.shown.moment.seq >= this.history.last && !this.shown.live) this.goTo(0);
    this.clock = this.shown.moment.t;
    this.before = 0;
    const atEnd = this.shown.moment.seq >= this.history.last;
    this.set({ playing: playing && !atEnd, following: playing && this.shown.live && atEnd });
    if (playing) this.later();
  }

  speed(speed: number): void {
    this.set({ speed });
  }

  select(selection: Selection | null): void {
    this.set({ selection });
  }

  private set(change: Partial<Shown>): void {
    this.shown = { ...this.shown, ...change };
    turns.show(this.shown.moment);
    for (const listener of this.listeners) listener();
  }

  /** While a long trace comes in, how much of it is there is drawn a few times a second, not for each batch. */
  private waits(): boolean {
    const coming = this.history.last < this.shown.expected && this.shown.moment.seq > 0 && !this.shown.following;
    const now = performance.now();
    if (coming && now - this.drawn < LOADING_MS) return true;
    this.drawn = now;
    return false;
  }

  /** Draw once for whatever comes in until the next frame. */
  private later(): void {
    this.drawing ||= requestAnimationFrame((now) => {
      this.drawing = 0;
      this.draw(now);
    });
  }

  private draw(now: number): void {
    const { moment, playing, following } = this.shown;
    const last = this.history.last;
    let seq = moment.seq;
    if (following || this.opening) seq = last;
    else if (playing) seq = this.played(now, seq);
    else if (this.wanted !== null && last >= this.wanted) seq = this.wanted;
    if (this.wanted !== null && last >= this.wanted) this.wanted = null;
    if (last >= this.shown.expected) this.opening = false;
    const over = playing && seq >= last;
    const next = seq === moment.seq ? moment : this.history.at(seq);
    this.set({ moment: next, last, expected: Math.max(this.shown.expected, last), ...(over && { playing: false, following: this.shown.live }) });
    if (this.shown.playing) this.later();
  }

  /** The record reached when the clock of the run went on since the last frame; never slower than one in two seconds. */
  private played(now: number, seq: number): number {
    const elapsed = this.before ? Math.min(now - this.before, 200) / 1000 : 0;
    this.before = now;
    this.clock += elapsed * this.shown.speed;
    const coming = this.history.record(seq + 1);
    if (coming && coming.t - this.clock > 2 * this.shown.speed) this.clock = coming.t - 2 * this.shown.speed;
    return Math.max(seq, this.history.seqAt(this.clock));
  }
}

/** Of the protocol, and of the trace: what the page was made for. */
const FORMAT = "dsc-view/1";
const VERSION = 2;

function strange({ format, header }: Hello): string | null {
  if (format !== FORMAT) return `The program speaks ${String(format)}, this page ${FORMAT}: load it again.`;
  const { version = VERSION } = header;
  return version === VERSION ? null : `The trace has version ${String(version)}; this page shows version ${VERSION}.`;
}

export const session = new Session();

export function useShown(): Shown {
  return useSyncExternalStore(session.subscribe, session.get);
}

export function useSelection(): Selection | null {
  return useSyncExternalStore(session.subscribe, () => session.get().selection);
}

/** What there is to see: a run, one that neither plans nor draws a world, or a store of knowledge. */
export type Kind = "run" | "chart" | "store";

export function useKind(): Kind {
  return useSyncExternalStore(session.subscribe, () => session.kind);
}

/** Whether the run may be changed from here. */
export function useControl(): boolean {
  return useSyncExternalStore(session.subscribe, () => session.get().control);
}
