/** Panes that take turns, for React: each has its own moment, the one of its last turn. */

import { createContext, useContext, useEffect, useState, useSyncExternalStore, type ReactNode } from "react";
import { flushSync } from "react-dom";
import { beginning, type Moment } from "./core/moment";
import { Turns, type Pane } from "./core/turns";
import { Boundary } from "./Boundary";

export const turns = new Turns<Moment>(beginning(), {
  now: () => performance.now(),
  frame: (draw) => requestAnimationFrame(draw),
  later: (act, ms) => setTimeout(act, ms),
  forget: (timer) => clearTimeout(timer as number),
  busy: (is) => void (document.body.ariaBusy = String(is)),
});

class Shown implements Pane<Moment> {
  private moment = turns.moment;
  private changed: () => void = () => undefined;

  subscribe = (changed: () => void): (() => void) => {
    this.changed = changed;
    this.moment = turns.moment;
    return turns.join(this);
  };

  get = (): Moment => this.moment;

  draw(moment: Moment): void {
    this.moment = moment;
    flushSync(this.changed); // now, so that what it takes is counted
  }
}

const Here = createContext<Moment | null>(null);

/** A pane: what is inside shows the moment of its last turn. */
export function Turn({ children }: { children: ReactNode }) {
  const [shown] = useState(() => new Shown());
  const moment = useSyncExternalStore(shown.subscribe, shown.get);
  return <Here value={moment}><Boundary about={moment}>{children}</Boundary></Here>;
}

/** The moment that the pane shows. */
export function useMoment(): Moment {
  return useContext(Here) ?? turns.moment;
}

/** An effect that would make each frame longer: it waits until nothing moves. */
export function useCalmEffect(act: () => void, on: readonly unknown[]): void {
  // eslint-disable-next-line react-hooks/exhaustive-deps
  useEffect(() => turns.whenCalm(act), on);
}
