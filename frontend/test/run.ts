/** A small run by hand: a plan of two steps breaks, another one follows. */

import type { Rec } from "../src/core/records";

const said: [number, string, number | null, object][] = [
  [0, "world", null, { version: 1, nodes: { cup: "item" }, facts: [["on", "cup", "table"], ["at", "table"]], values: [] }],
  [0, "plot", null, { name: "main", hash: "main", plot: { plot: "main", states: { clear: { dynamic: ["ask"], goal: "(done)" } } } }],
  [0, "plot", null, { name: "plan_1", hash: "p1", plot: plan("plan_1", "(pick-up cup)", "(drive sink)") }],
  [0, "step", null, { microsteps: [{ event: null, taken: [], exited: [], entered: ["clear", "clear/plan"], bound: [
    { state: "", plot: "main", hash: "main" }, { state: "clear", plot: "achieve", hash: "achieve" }] }] }],
  [1, "plan.found", 4, { plot: "plan_1", steps: ["(pick-up cup)", "(drive sink)"], engine: "hand" }],
  [1, "event", 5, { name: "plan_found", source: "planner", attributes: {} }],
  [1, "step", 6, {
    variables: { "clear/execute": { reason: "unknown" } },
    microsteps: [
      { event: "plan_found", taken: [{ from: "clear/plan", on: "plan_found", to: "clear/execute" }], exited: ["clear/plan"],
        entered: ["clear/execute"], bound: [{ state: "clear/execute", plot: "plan_1", hash: "p1" }] },
      { event: null, taken: [{ from: "clear/execute/before", on: "always", to: "clear/execute/step_1" }], exited: [],
        entered: ["clear/execute/step_1"] }] }],
  [1, "decision", 7, { state: "clear/execute/step_1", chosen: "above", satisfied: false, arguments: {}, version: 1, candidates: [] }],
  [2, "step", 7, { microsteps: [{ event: "done", taken: [{ from: "clear/execute/step_1", on: "done", to: "clear/execute/step_2" }],
    exited: ["clear/execute/step_1"], entered: ["clear/execute/step_2"] }] }],
  [3, "knowledge", null, { version: 2, author: "somebody", removed: [["at", "table"]], added: [["at", "sink"]] }],
  [3, "plan.broken", 10, { reason: "(at table) is false", author: "somebody", step: 2 }],
  [3, "step", 11, { microsteps: [{ event: "plan_invalid", taken: [{ from: "clear/execute", on: "plan_invalid", to: "clear/plan" }],
    exited: ["clear/execute/step_2", "clear/execute"], entered: ["clear/plan"] }] }],
  [4, "plan.found", 12, { plot: "plan_2", steps: ["(drive table)"], engine: "hand" }],
  [4, "plot", null, { name: "plan_2", hash: "p2", plot: plan("plan_2", "(drive table)") }],
  [4, "step", 13, { microsteps: [{ event: "plan_found", taken: [{ from: "clear/plan", on: "plan_found", to: "clear/execute" }],
    exited: ["clear/plan"], entered: ["clear/execute", "clear/execute/step_1"],
    bound: [{ state: "clear/execute", plot: "plan_2", hash: "p2" }] }] }],
  [5, "knowledge", 15, { version: 3, author: "arm", values: [["tries", "cup", 1]] }],
];

function plan(name: string, ...steps: string[]): object {
  return { plot: name, generated: true, states: Object.fromEntries(steps.map((about, i) => [`step_${i + 1}`, { about, dynamic: ["x"] }])) };
}

export const run: readonly Rec[] = said.map(([t, type, cause, data], i) => ({ seq: i + 1, t, type, cause, ...data }));

/** The run again and again, numbered on, until there are `count` records. */
export function repeated(records: readonly Rec[], count: number): Rec[] {
  return Array.from({ length: count }, (_, i) => {
    const round = Math.floor(i / records.length);
    const rec = records[i % records.length]!;
    const on = round * records.length;
    return { ...rec, seq: i + 1, t: rec.t + 10 * round, cause: rec.cause === null ? null : rec.cause + on };
  });
}
