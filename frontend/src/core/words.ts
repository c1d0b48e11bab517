/** Words for names: what the author wrote, not what rules, handlers and plans were expanded into. */

import { kept, statesOf, type PlotForm } from "./plots";

/** A state that a plan was expanded into: gates before and after a step, the step, its next try, its omission. */
const OF_STEP = /^(before|after|step)_(\d+)(?:_(again|skipped))?$/;
const PLACES = new Map([["before", "before "], ["after", "after "], ["again", "again "], ["skipped", "skips "]]);

const abouts = new WeakMap<PlotForm, ReadonlyMap<string, string | undefined>>();

/** The name of a state for people; a region is named `STATE:REGION`. */
export function stateWords(plot: PlotForm | undefined, name: string): string {
  return wordsIn(plot?.words?.states, name) ?? ((plot?.generated && planWords(plot, name)) || name.split(":").at(-1)!);
}

function planWords(plot: PlotForm, name: string): string | undefined {
  if (name === "before") return "begin";
  const [, place = "", number, more] = OF_STEP.exec(name) ?? [];
  const about = kept(abouts, plot, () => new Map(statesOf(plot).map((state) => [state.name, state.form.about]))).get(`step_${number}`);
  return about && `${PLACES.get(more ?? place) ?? ""}${number} ${about.replace(/^\(|\)$/g, "")}`;
}

/** The name of an event for people. */
export function eventWords(plot: PlotForm | undefined, name: string): string {
  return wordsIn(plot?.words?.events, name) ?? name;
}

/** The words that a plot's record has for a name; undefined for a name that its author wrote. */
export function wordsIn(words: Readonly<Record<string, string>> | undefined, name: string): string | undefined {
  return words && Object.hasOwn(words, name) ? words[name] : undefined; // `constructor` is a name like others
}
