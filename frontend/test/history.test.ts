import { describe, expect, it } from "vitest";
import { CHECKPOINT_EVERY, History } from "../src/core/history";
import { endOf, kinOf, nextOf } from "../src/core/plans";
import { recordsIn } from "../src/core/reading";
import type { Rec } from "../src/core/records";
import { repeated, run } from "./run";

const history = (records: readonly Rec[]) => {
  const made = new History();
  made.append(1, records);
  return made;
};

describe("a moment", () => {
  it("has the active states, with the plots inside them", () => {
    const moment = history(run).at(4);
    expect([...moment.active.keys()]).toEqual(["clear", "clear/plan"]);
    expect([...moment.bound]).toEqual([["", "main"], ["clear", "achieve"]]);
  });

  it("has what is known: the world at the start and its changes", () => {
    const moment = history(run).at(run.length);
    expect([...moment.facts.keys()].sort()).toEqual(["(at sink)", "(on cup table)"]);
    expect(moment.values.get("(tries cup)")).toEqual(["tries", "cup", 1]);
    expect(moment.version).toBe(3);
  });

  it("knows a plan's steps before, while and after they are carried out", () => {
    const made = history(run);
    const states = (seq: number) => made.at(seq).plans.map((plan) => plan.steps.map((step) => step.state));
    expect(states(5)).toEqual([["waiting", "waiting"]]);
    expect(states(7)).toEqual([["running", "waiting"]]);
    expect(nextOf(made.at(7).plans[0]!, [0, 1])).toBe(1);
    expect(states(9)).toEqual([["done", "running"]]);
    expect(states(13)).toEqual([["done", "stopped"], ["waiting"]]);
    expect(made.at(13).plans.map((plan) => plan.ended)).toEqual([11, null]);
    expect(states(15)).toEqual([["done", "stopped"], ["running"]]);
  });

  it("has a plan as it is carried out: with its links, and without what was done meanwhile", () => {
    const links = [[0, "(at a)", 1], [1, "(holding cup)", 2], [2, "(tidy cup)", 3]];
    const made = history([...run.slice(0, 5), { seq: 6, t: 1, type: "plan.ordered", cause: null, plot: "plan_1", steps: ["(go a)", "(put cup)"], links } as Rec]);
    const [plan] = made.at(6).plans;
    expect(plan!.steps.map((step) => step.text)).toEqual(["(go a)", "(put cup)"]);
    expect(plan!.links).toEqual(links);
    expect([kinOf(plan!, 0, 1), kinOf(plan!, 1, 0), kinOf(plan!, 0, 0)]).toEqual(["provider", "user", null]);
  });

  it("knows what broke a plan also if another one was found while it went on", () => {
    const rest = [run[12]!, { type: "rule", rule: "slipped: wait, retry", state: "clear/execute/step_2" }, run[11]!];
    const later = rest.map((rec, i) => ({ t: 4, cause: null, ...rec, seq: 12 + i }) as Rec);
    const made = history([...run.slice(0, 11), ...later]);
    expect(made.at(14).plans.map((plan) => [plan.name, plan.ended])).toEqual([["plan_1", 11], ["plan_2", null]]);
  });

  it("tells a plan that was interrupted from one that was given up", () => {
    const away = { event: "low", taken: [{ from: "clear", on: "low", to: "charge" }], exited: ["clear/execute/step_2", "clear/execute", "clear"], entered: ["charge"] };
    const interrupted = [...run.slice(0, 10), { seq: 11, t: 3, type: "step", cause: 10, microsteps: [away] } as Rec];
    expect(history(interrupted).at(11).plans.map(endOf)).toEqual(["interrupted"]);
    expect(history(run).at(13).plans.map(endOf)).toEqual(["given up", ""]);
  });

  it("knows a step that goes on in the plan that replaces its own", () => {
    const execute = "clear/execute";
    const form = { plot: "plan_9", generated: true, states: { step_1: { about: "(take cup)", dynamic: ["take"] }, step_7: { about: "(go b)", dynamic: ["go"] } } };
    const kept = { event: "plan_found", taken: [], exited: [execute], entered: [execute], bound: [{ state: execute, plot: "plan_9", hash: "h9" }] };
    const rest = [
      { type: "plan.ordered", plot: "plan_9", steps: ["(take cup)", "(go b)"], links: [] },
      { type: "plot", name: "plan_9", hash: "h9", plot: form },
      { type: "step", microsteps: [kept] },
    ].map((data, i) => ({ seq: 8 + i, t: 4, cause: null, ...data }) as unknown as Rec);
    const made = history([...run.slice(0, 7), ...rest]);
    expect(made.at(7).plans[0]!.steps[0]!.state).toBe("running");
    const [old, next] = made.at(10).plans;
    expect(old!.ended).not.toBeNull();
    expect(next!.steps.map((step) => step.state)).toEqual(["running", "waiting"]);
  });

  it("does not blame a rule after which the step was begun again for the end of the plan", () => {
    const execute = "clear/execute";
    const again = { event: "slipped", taken: [], exited: [`${execute}/step_1`], entered: [`${execute}/step_1`] };
    const over = { event: "done", taken: [{ from: `${execute}/step_1`, on: "done", to: `${execute}/finished` }], exited: [`${execute}/step_1`, execute], entered: [] };
    const rest = [
      { type: "rule", rule: "slipped: wait, retry", state: `${execute}/step_1` },
      { type: "step", microsteps: [again] },
      { type: "step", microsteps: [over] },
    ].map((data, i) => ({ seq: run.length + 1 + i, t: 6 + i, cause: null, ...data }));
    const plan = history([...run, ...rest]).at(run.length + 3).plans[1]!;
    expect(plan.ended).toBe(run.length + 3);
    expect(plan.steps.map((step) => [step.state, step.tries])).toEqual([["done", 2]]);
  });

  it("has the skills at work: not those that ended, nor those whose state was left", () => {
    const actions = [["start", "a1"], ["start", "a2"], ["cancel", "a1"]];
    const recs = actions.map(([action, id], i) => ({ seq: i + 1, t: 0, type: "action", cause: null, action, id, skill: id }) as Rec);
    const made = history([...recs, { seq: 4, t: 1, type: "event", cause: 2, name: "done" } as Rec]);
    const working = (seq: number) => [...made.at(seq).working.values()].map((one) => one.id);
    expect([2, 3, 4].map(working)).toEqual([["a1", "a2"], ["a2"], []]);
  });

  it("has the skill for which another one waits, until its turn comes", () => {
    const actions = [["start", "a1"], ["start", "a2"], ["wait", "a2"], ["begin", "a2"]];
    const recs = actions.map(([action, id], i) => ({ seq: i + 1, t: 0, type: "action", cause: null, action, id, skill: id, ...(action === "wait" ? { for: "a1 of state 's'" } : {}) }) as Rec);
    const awaited = (seq: number) => [...history(recs).at(seq).working.values()].map((one) => one.for);
    expect([2, 3, 4].map(awaited)).toEqual([[undefined, undefined], [undefined, "a1 of state 's'"], [undefined, undefined]]);
  });

  it("has the transitions taken last, the latest first", () => {
    expect(history(run).at(9).trail.map((one) => one.to)).toEqual(["clear/execute/step_2", "clear/execute/step_1", "clear/execute"]);
  });

  it("forgets what a state that was left had", () => {
    const moment = history(run).at(13);
    expect(moment.bound.has("clear/execute")).toBe(false);
    expect(moment.variables.has("clear/execute")).toBe(false);
  });

  it("has the variables of the plots that run", () => {
    expect(history(run).at(7).variables.get("clear/execute")).toEqual({ reason: "unknown" });
  });
});

describe("history", () => {
  it("gives the same moment however one got there", () => {
    const records = repeated(run, 2 * CHECKPOINT_EVERY + 40);
    const made = history(records);
    for (const seq of [records.length, 0, 1, CHECKPOINT_EVERY, CHECKPOINT_EVERY - 1, CHECKPOINT_EVERY + 1, 33, 34]) {
      expect(made.at(seq)).toEqual(history(records.slice(0, seq)).at(seq));
    }
  });

  it("is not disturbed by who changes a moment it gave", () => {
    const made = history(run);
    made.at(7).active.clear();
    expect(made.at(7).active.size).toBeGreaterThan(0);
  });

  it("passes over what it has, and does not take in what leaves a gap", () => {
    const made = history(run.slice(0, 6));
    made.append(3, run.slice(2, 8));
    made.append(10, run.slice(9));
    expect(made.last).toBe(8);
  });

  it("has the last decision of a state, up to a record", () => {
    const made = history(run);
    expect(made.decisionOf("clear/execute/step_1", run.length)?.seq).toBe(8);
    expect(made.decisionOf("clear/execute/step_1", 7)).toBeUndefined();
    expect(made.decisionOf("clear", run.length)).toBeUndefined();
  });

  it("reads what is heavy when it is looked at, and has then what the record says", () => {
    const heavy = [{ type: "scene", things: [{ id: "cup", label: "a, \"cup\"" }] }, { type: "decision", state: "clear", chosen: "above" }, { type: "log", text: "x" }];
    const said = heavy.map((rec, i) => ({ seq: i + 1, t: i + 0.5, cause: i || null, ...rec }));
    // As Python writes it: blanks behind colons and commas.
    const lines = said.map(({ seq, t, type, cause, ...rest }) => `{"seq": ${seq}, "t": ${t}, "type": "${type}", "cause": ${cause}, ${JSON.stringify(rest).slice(1)}`);
    const { from, records } = recordsIn(`{"type":"records","from":1,"records":[\n${lines.join(",\n")}\n]}`);
    expect([from, records.length]).toEqual([1, 3]);
    expect(records[0]).not.toHaveProperty("things");
    const made = history(records);
    expect(made.at(3).scene).toBe(1);
    expect([1, 2, 3].map((seq) => made.record(seq))).toEqual(said);
    expect(made.decisionOf("clear", 3)).toEqual(said[1]);
  });

  it("jumps to marks both ways", () => {
    const made = history(run);
    expect(made.beside(0, "plan", 1)).toBe(5);
    expect(made.beside(5, "plan", 1)).toBe(13);
    expect(made.beside(13, "plan", -1)).toBe(5);
    expect(made.beside(13, "plan", 1)).toBeUndefined();
    expect(made.beside(run.length, "failure", -1)).toBe(11);
  });

  it("finds the last record at a time, and what led to a record", () => {
    const made = history(run);
    expect(made.seqAt(1)).toBe(8);
    expect(made.seqAt(-1)).toBe(0);
    expect(made.causes(11).map((rec) => rec.seq)).toEqual([11, 10]);
  });
});
