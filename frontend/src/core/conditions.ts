/** Conditions that states watch: their truth at a moment, with the truth of their parts, and the past ones (S2.13, S2.19). */

import type { ActionRec, EventRec } from "./records";

export interface Condition {
  readonly text: string;
  /** Who evaluates it: `hand.watch_values` or `conditions.watch_truth`. */
  readonly skill: string;
  readonly id: string | undefined;
  readonly since: number;
  readonly truth: boolean | null;
  /** The truth of each part at the last flip; null where it was unknown. */
  readonly parts: Readonly<Record<string, unknown>>;
  readonly flips: number;
  /** Second of the last flip. */
  readonly last: number | null;
  /** Second at which the state was left, or the evaluation failed. */
  readonly ended: number | null;
}

/** By the seq of the record that started the watch. */
export type Conditions = Map<number, Condition>;

/** The most past conditions that are kept. */
export const MOST_PAST = 100;
const WATCHES = /\.watch_(values|truth)$/;

export function isWatch(skill: string | undefined): boolean {
  return skill !== undefined && WATCHES.test(skill);
}

export function withWatch(conditions: Conditions, rec: ActionRec): void {
  const { action, skill, id } = rec;
  if (skill === undefined || !isWatch(skill)) return;
  const text = rec.arguments?.condition;
  if (action === "start" && typeof text === "string") {
    conditions.set(rec.seq, { text, skill, id, since: rec.t, truth: null, parts: {}, flips: 0, last: null, ended: null });
  } else if (action === "cancel") {
    for (const [seq, one] of conditions) if (one.id === id && one.ended === null) end(conditions, seq, rec.t);
  }
}

/** A flip; another event of a watch is its failure. */
export function withReport(conditions: Conditions, rec: EventRec): void {
  const one = rec.cause === null ? undefined : conditions.get(rec.cause);
  if (one === undefined || rec.cause === null) return;
  const name = rec.original ?? rec.name;
  if (name !== "became_true" && name !== "became_false") return end(conditions, rec.cause, rec.t);
  const { parts } = rec.attributes;
  const known = parts !== null && typeof parts === "object" && !Array.isArray(parts) ? (parts as Record<string, unknown>) : {};
  conditions.set(rec.cause, { ...one, truth: name === "became_true", parts: known, flips: one.flips + 1, last: rec.t });
}

function end(conditions: Conditions, seq: number, t: number): void {
  const one = conditions.get(seq)!;
  conditions.delete(seq); // the latest past ones come last
  conditions.set(seq, { ...one, ended: t });
  const past = [...conditions].filter(([, each]) => each.ended !== null);
  for (const [old] of past.slice(0, Math.max(0, past.length - MOST_PAST))) conditions.delete(old);
}
