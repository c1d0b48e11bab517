/** What the form of a plot says: its states, who is inside whom, and the ways between them. */

import type { Value, Words } from "./values";

export interface WayForm {
  readonly to?: string;
  readonly when?: string;
  readonly rule?: string;
  readonly emit?: string;
  readonly seconds?: number;
}

export interface StateForm {
  readonly about?: string;
  readonly states?: Readonly<Record<string, StateForm>>;
  readonly regions?: Readonly<Record<string, { readonly states: Readonly<Record<string, StateForm>>; readonly initial?: string }>>;
  readonly initial?: string;
  readonly use?: string;
  readonly dynamic?: readonly string[];
  readonly goal?: string;
  readonly final?: boolean;
  readonly history?: string;
  readonly choice?: unknown;
  readonly select?: unknown;
  readonly with?: Readonly<Record<string, Value>>;
  readonly on?: Readonly<Record<string, readonly WayForm[]>>;
  readonly after?: readonly WayForm[];
  readonly every?: readonly WayForm[];
  readonly always?: readonly WayForm[];
  readonly entry?: readonly unknown[];
  readonly exit?: readonly unknown[];
}

export interface PlotForm {
  readonly plot: string;
  readonly about?: string;
  readonly generated?: boolean;
  readonly when?: string;
  readonly parameters?: Readonly<Record<string, unknown>>;
  readonly variables?: Readonly<Record<string, unknown>>;
  readonly states: Readonly<Record<string, StateForm>>;
  readonly initial?: string;
  /** Of its record, not of its form. */
  readonly words?: Words;
}

export type Kind = "simple" | "composite" | "orthogonal" | "region" | "submachine" | "dynamic" | "final" | "pseudo";

export interface PlotState {
  readonly name: string;
  readonly kind: Kind;
  readonly form: StateForm;
  /** Name of the state (or region) around it; null directly inside the plot. */
  readonly parent: string | null;
  readonly initial: boolean;
}

export interface Way {
  readonly from: string;
  readonly to: string;
  readonly on: string;
  readonly when?: string | undefined;
  readonly rule?: string | undefined;
}

export function kindOf(form: StateForm): Kind {
  if (form.use !== undefined) return "submachine";
  if (form.dynamic !== undefined || form.goal !== undefined) return "dynamic";
  if (form.states !== undefined) return "composite";
  if (form.regions !== undefined) return "orthogonal";
  if (form.final) return "final";
  return form.history !== undefined || form.choice !== undefined || form.select !== undefined ? "pseudo" : "simple";
}

const states = new WeakMap<PlotForm, readonly PlotState[]>();
const ways = new WeakMap<PlotForm, readonly Way[]>();

/** All states of a plot in document order; regions are there too, named `STATE:REGION`. */
export function statesOf(plot: PlotForm): readonly PlotState[] {
  return kept(states, plot, () => foundStates(plot));
}

/** The transitions between the states of a plot. */
export function waysOf(plot: PlotForm): readonly Way[] {
  return kept(ways, plot, () => foundWays(statesOf(plot)));
}

/** A plot never changes: what was found in it is kept. */
export function kept<T>(cache: WeakMap<PlotForm, T>, plot: PlotForm, find: () => T): T {
  let found = cache.get(plot);
  if (found === undefined) cache.set(plot, (found = find()));
  return found;
}

function foundStates(plot: PlotForm): PlotState[] {
  const found: PlotState[] = [];
  const walk = (states: Readonly<Record<string, StateForm>>, parent: string | null, first: string | undefined) => {
    const initial = first ?? Object.keys(states)[0];
    for (const [name, given] of Object.entries(states)) {
      const form = given ?? {};
      found.push({ name, kind: kindOf(form), form, parent, initial: name === initial });
      if (form.states) walk(form.states, name, form.initial);
      for (const [region, inside] of Object.entries(form.regions ?? {})) {
        const id = `${name}:${region}`;
        found.push({ name: id, kind: "region", form: {}, parent: name, initial: false });
        walk(inside.states, id, inside.initial);
      }
    }
  };
  walk(plot.states, null, plot.initial);
  return found;
}

function foundWays(states: readonly PlotState[]): Way[] {
  const found: Way[] = [];
  const known = new Set(states.map((state) => state.name));
  for (const { name, form } of states) {
    const triggered: [string, readonly WayForm[]][] = [
      ...Object.entries(form.on ?? {}),
      ["after", form.after ?? []],
      ["every", form.every ?? []],
      ["always", form.always ?? []],
    ];
    for (const [on, ways] of triggered) {
      for (const way of ways) {
        if (way.to === undefined || !known.has(way.to)) continue;
        const said = on === "after" && way.seconds !== undefined ? `after ${way.seconds} s` : on;
        found.push({ from: name, to: way.to, on: said, when: way.when, rule: way.rule });
      }
    }
  }
  return found;
}

/** Of a generated plot: name of a state -> the number (from 0) of the plan's step that it carries out. */
export function stepsOf(plot: PlotForm, steps: readonly string[]): Map<string, number> {
  const found = new Map<string, number>();
  const free = new Set(steps.keys());
  for (const { name, kind, form } of statesOf(plot)) {
    if (kind !== "dynamic" && kind !== "submachine") continue;
    const named = Number(/(\d+)$/.exec(name)?.[1] ?? 0) - 1;
    const number = steps[named] === form.about && free.has(named) ? named : steps.findIndex((s, i) => free.has(i) && s === form.about);
    if (number < 0) continue;
    found.set(name, number);
    free.delete(number);
  }
  return found;
}

/** The plan's steps as a generated plot alone tells them: for plans that no `plan.found` announced. */
export function stepTexts(plot: PlotForm): string[] {
  return statesOf(plot)
    .filter(({ kind, form }) => (kind === "dynamic" || kind === "submachine") && form.about?.startsWith("("))
    .map(({ form }) => form.about ?? "");
}

/** `clear/execute/step_2` -> `["clear/execute", "step_2"]`: the path of the plot's holder, and the state's own name. */
export function splitPath(path: string): [string, string] {
  const at = path.lastIndexOf("/");
  return at < 0 ? ["", path] : [path.slice(0, at), path.slice(at + 1)];
}

export function joinPath(holder: string, name: string): string {
  return holder ? `${holder}/${name}` : name;
}
