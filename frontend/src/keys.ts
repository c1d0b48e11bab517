/** Keys that move through time, wherever the focus is, except in text. */

import { useEffect } from "react";
import { session } from "./session";

export function useKeys(): void {
  useEffect(() => {
    const pressed = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.metaKey || event.altKey || writes(event.target)) return;
      if (document.querySelector("dialog[open]")) return; // the keys are its own, Esc too
      const act = KEYS.get(event.shiftKey && event.key.startsWith("Arrow") ? `Shift+${event.key}` : event.key);
      if (!act || (event.key === " " && event.target instanceof HTMLButtonElement)) return;
      event.preventDefault();
      act();
    };
    addEventListener("keydown", pressed);
    return () => removeEventListener("keydown", pressed);
  }, []);
}

const now = () => session.get().moment.seq;

const KEYS: ReadonlyMap<string, () => unknown> = new Map(Object.entries<() => unknown>({
  " ": () => session.play(!(session.get().playing || session.get().following)),
  ArrowRight: () => session.step(1),
  ArrowLeft: () => session.step(-1),
  "Shift+ArrowRight": () => session.goTo(now() + 1),
  "Shift+ArrowLeft": () => session.goTo(now() - 1),
  "]": () => session.jump("failure", 1),
  "[": () => session.jump("failure", -1),
  "}": () => session.jump("plan", 1),
  "{": () => session.jump("plan", -1),
  ".": () => session.jump("decision", 1),
  ",": () => session.jump("decision", -1),
  Home: () => session.goTo(0),
  End: () => session.goTo(session.history.last),
  Escape: () => session.select(null),
}));

function writes(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  return target.isContentEditable || target.matches("textarea, select, input:not([type=range])");
}
