/** The shapes of records, checked where they come in: panes rely on them, and a record of another shape is damaged. */

import type { Rec } from "./records";

/** A record that cannot be read, or does not say what one of its type says. */
export interface Damaged extends Rec {
  readonly type: "damaged";
  readonly why: string;
  /** In the file of the trace, from 1; a trace has its header on line 1. */
  readonly line: number;
  /** The beginning of what stands there. */
  readonly text: string;
}

/** What is nested deeper is no record of ours, and would take each pane's stack. */
const DEEPEST = 100;
const SHOWN = 200;

type Is = (value: unknown, depth: number) => boolean;
type Object_ = Readonly<Record<string, unknown>>;

const any: Is = () => true;
const text: Is = (value) => typeof value === "string";
const truth: Is = (value) => typeof value === "boolean";
const number: Is = (value) => typeof value === "number" && Number.isFinite(value);
const count: Is = (value) => Number.isInteger(value) && (value as number) >= 0;
const scalar: Is = (value) => ["string", "number", "boolean"].includes(typeof value) || value === null;
const optional = (is: Is): Is => (value, depth) => value === undefined || value === null || is(value, depth);
const list = (of: Is): Is => (value, depth) => depth < DEEPEST && Array.isArray(value) && value.every((one) => of(one, depth + 1));
const isObject = (value: unknown): value is Object_ => typeof value === "object" && value !== null && !Array.isArray(value);
const dict = (of: Is): Is => (value, depth) => depth < DEEPEST && isObject(value) && Object.values(value).every((one) => of(one, depth + 1));
const fields = (shape: Readonly<Record<string, Is>>): Is => {
  const all = Object.entries(shape);
  return (value, depth) => depth < DEEPEST && isObject(value) && all.every(([name, is]) => is(own(value, name), depth + 1));
};

const texts = list(text);
const fact: Is = (value, depth) => list(scalar)(value, depth) && (value as readonly unknown[]).length > 0;
const facts = list(fact);
/** Arguments, then a scalar or a geometry. */
const content: Is = (value, depth) =>
  Array.isArray(value) && value.length > 0 && fact(value.slice(0, -1).concat(0), depth) && (scalar(value.at(-1), depth) || list(number)(value.at(-1), depth + 1));
const contents = list(content);

const way = fields({ to: optional(text), when: optional(text), rule: optional(text), seconds: optional(scalar) });
const ways = optional(list(way));
const state: Is = (value, depth) => optional(stateFields)(value, depth);
const stateFields = fields({
  about: optional(text), states: optional(dict(state)), regions: optional(dict(fields({ states: dict(state), initial: optional(text) }))),
  initial: optional(text), use: optional(text), dynamic: optional(texts), goal: optional(text), on: optional(dict(list(way))),
  after: ways, every: ways, always: ways,
});
const form = fields({
  plot: text, about: optional(text), when: optional(text), generated: optional(truth), initial: optional(text), states: dict(state),
});
/** Paths are made of the names of states: a name that comes twice would lead in circles. */
const plot: Is = (value, depth) => form(value, depth) && distinct(namesIn(value as Object_));

const words = fields({ states: optional(dict(text)), events: optional(dict(text)), variables: optional(dict(text)) });

const explanation: Is = (value, depth) => explanationFields(value, depth);
const explanationFields = fields({ text: optional(text), detail: optional(text), decider: optional(count), children: optional(list(explanation)) });
const candidate = fields({ plot: text, reason: optional(text), condition: explanation, score: optional(scalar), learned: optional(text) });
const thing = fields({
  id: text, shape: optional(text), x: optional(number), y: optional(number), label: optional(text), width: optional(number),
  depth: optional(number), in: optional(text), to_x: optional(number), to_y: optional(number),
});
const micro = fields({
  event: optional(text), taken: list(fields({ from: text, on: text, to: optional(text) })), exited: texts, entered: texts,
  bound: optional(list(fields({ state: text, plot: text, hash: text }))),
});
const link: Is = (value) => Array.isArray(value) && value.length === 3 && count(value[0], 0) && text(value[1], 0) && count(value[2], 0);

const SHAPES = new Map<string, readonly (readonly [string, Is])[]>([
  ["plot", [["hash", text], ["plot", plot], ["words", optional(words)]]],
  ["step", [["microsteps", list(micro)], ["variables", optional(dict(dict(any)))]]],
  ["decision", [["state", text], ["chosen", optional(text)], ["by", optional(text)], ["arguments", optional(dict(any))], ["version", optional(number)], ["candidates", optional(list(candidate))]]],
  ["world", [["version", number], ["nodes", dict(text)], ["facts", facts], ["values", contents]]],
  ["knowledge", [["version", number], ["author", text], ["nodes", optional(dict(text))], ["removed_nodes", optional(texts)],
    ["added", optional(facts)], ["removed", optional(facts)], ["values", optional(contents)]]],
  ["action", [["action", text], ["skill", optional(text)], ["port", optional(text)], ["component", optional(text)],
    ["mode", optional(text)], ["arguments", optional(dict(any))]]],
  ["component", [["component", text], ["wires", optional(dict(optional(text)))], ["waits", optional(text)]]],
  ["observation", [["component", text], ["entry", text]]],
  ["plots", [["installed", optional(texts)], ["components", optional(texts)], ["replaced", optional(texts)], ["removed", optional(texts)], ["refused", optional(text)]]],
  ["event", [["name", text], ["source", optional(text)]]],
  ["scene", [["things", list(thing)]]],
  ["rule", [["rule", text], ["state", text]]],
  ["end", [["problem", optional(text)], ["reason", optional(text)]]],
  ["plan.asked", [["goal", text]]],
  ["plan.none", [["reason", text]]],
  ["plan.found", [["plot", text], ["steps", texts], ["engine", optional(text)]]],
  ["plan.ordered", [["plot", text], ["steps", texts], ["links", optional(list(link))]]],
  ["plan.skipped", [["plot", text], ["steps", texts]]],
  ["plan.broken", [["reason", text], ["author", text], ["link", optional(fields({ fact: text, user: text }))]]],
  ["damaged", [["why", text], ["line", count], ["text", text]]],
]);

/** The record in a value, or the one that says how it is damaged. */
export function sound(said: unknown, seq: number): Rec {
  const why = wrongIn(said, seq);
  return why === null ? (said as Rec) : damaged(seq, why, shortly(said));
}

export function damaged(seq: number, why: string, said: string, t = NaN): Damaged {
  return { seq, t, type: "damaged", cause: null, why, line: seq + 1, text: said.slice(0, SHOWN) };
}

export function isDamaged(rec: Rec): rec is Damaged {
  return rec.type === "damaged";
}

/** What is wrong with a record, in words. */
function wrongIn(said: unknown, seq: number): string | null {
  if (!isObject(said)) return "it is no object";
  if (own(said, "seq") !== seq) return `it says that it is record ${shortly(own(said, "seq"))}`;
  if (!number(own(said, "t"), 0)) return "'t' is no number";
  if (!text(own(said, "type"), 0)) return "'type' is no text";
  const cause = own(said, "cause");
  if (cause !== null && !(count(cause, 0) && (cause as number) < seq)) return "'cause' is no record before it";
  const wrong = SHAPES.get(said.type as string)?.find(([name, is]) => !is(own(said, name), 0));
  return wrong ? `'${wrong[0]}' is not what a record '${String(said.type)}' has there` : null;
}

/** What an object itself has under a name, never what all objects have. */
function own(value: Object_, name: string): unknown {
  return Object.hasOwn(value, name) ? value[name] : undefined;
}

/** Names of states, regions as `STATE:REGION`; null where one would not do in a path. */
function namesIn(plot: Object_): (string | null)[] {
  const inside = (states: unknown): (string | null)[] => Object.entries((states ?? {}) as Record<string, Object_ | null>).flatMap(([name, one]) => [
    name === "" || name.includes("/") ? null : name,
    ...inside(one?.states),
    ...Object.entries((one?.regions ?? {}) as Record<string, Object_>).flatMap(([region, of]) => [`${name}:${region}`, ...inside(of.states)]),
  ]);
  return inside(plot.states);
}

function distinct(names: readonly (string | null)[]): boolean {
  return !names.includes(null) && new Set(names).size === names.length;
}

function shortly(value: unknown): string {
  try {
    return (JSON.stringify(value) ?? "nothing").slice(0, SHOWN);
  } catch {
    return "something nested too deeply";
  }
}
