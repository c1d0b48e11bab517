/** What can be told about a plan from the records: who broke it, what its steps changed. */

import type { History } from "./history";
import { splitPath, statesOf, waysOf, type PlotForm } from "./plots";
import { written, type KnowledgeRec, type PlanBrokenRec } from "./records";
import type { Fact } from "./values";

/** So far back is looked for who changed something. */
const BACK = 400;

/** The change of the knowledge that broke a plan: of that version, or the last one that is about the fact, or about its things. */
export function breaker(history: History, broken: PlanBrokenRec): KnowledgeRec | null {
  const changes = history.before(broken.seq, "knowledge", BACK) as KnowledgeRec[];
  const exact = changes.find((change) => change.version === broken.version);
  if (exact) return exact;
  const fact = factIn(broken.link?.fact ?? broken.reason);
  if (fact === null) return changes[0] ?? null;
  const touches = (change: KnowledgeRec) => [...(change.added ?? []), ...(change.removed ?? [])].some((one) => written(one) === fact);
  const things = fact.slice(1, -1).split(" ").slice(1);
  const mentions = (change: KnowledgeRec) => things.some((thing) => mentioned(change).has(thing));
  return changes.find(touches) ?? changes.find(mentions) ?? null;
}

/** The innermost fact that a text such as `(not (on a b)) is false` names. */
export function factIn(text: string): string | null {
  return /\([^()]+\)/.exec(text)?.[0] ?? null;
}

function mentioned(change: KnowledgeRec): Set<string> {
  const facts: Fact[] = [...(change.added ?? []), ...(change.removed ?? [])];
  return new Set([...Object.keys(change.nodes ?? {}), ...facts.flatMap((fact) => fact.slice(1).map(String))]);
}

/** The changes of the knowledge between two times of a run, after a record. */
export function changesBetween(history: History, after: number, since: number, until: number): KnowledgeRec[] {
  return history.marks.knowledge
    .filter((seq) => seq > after)
    .map((seq) => history.record(seq) as KnowledgeRec)
    .filter((change) => change.t > since && change.t <= until);
}

/** What has to hold for a state of a plot to be entered, as its ways in say it. */
export function conditionsInto(plot: PlotForm, name: string): string[] {
  const ways = waysOf(plot).filter((way) => way.to === name && way.rule === undefined);
  return [...new Set(ways.map((way) => way.when).filter((when) => when !== undefined))];
}

/** Of a generated plot with regions: for each, its name and the numbers of the steps in it. */
export function lanesOf(plot: PlotForm, names: ReadonlyMap<string, number>): { name: string; steps: number[] }[] {
  const states = new Map(statesOf(plot).map((state) => [state.name, state]));
  const lanes = new Map<string, number[]>();
  for (const [name, step] of names) {
    let at = states.get(name);
    while (at && at.kind !== "region") at = at.parent === null ? undefined : states.get(at.parent);
    const lane = at?.name.split(":")[1] ?? "";
    lanes.set(lane, [...(lanes.get(lane) ?? []), step]);
  }
  return [...lanes].map(([name, steps]) => ({ name, steps: steps.sort((a, b) => a - b) }));
}

/** The last part of a path. */
export function nameOf(path: string): string {
  return splitPath(path)[1];
}
