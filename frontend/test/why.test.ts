import { expect, it } from "vitest";
import { deciding } from "../src/core/explanations";
import { History } from "../src/core/history";
import { stepsOf, type PlotForm } from "../src/core/plots";
import type { PlanBrokenRec } from "../src/core/records";
import { breaker, changesBetween, conditionsInto, factIn, lanesOf } from "../src/core/why";
import { run } from "./run";

const history = new History();
history.append(1, run);
const broken = run[10] as PlanBrokenRec;

it("finds who broke a plan: by version, by the fact, by the things in it", () => {
  const who = (change: Partial<PlanBrokenRec>) => breaker(history, { ...broken, ...change })?.seq;
  expect(who({})).toBe(10);
  expect(who({ version: 2, reason: "something else" })).toBe(10);
  expect(who({ reason: "(cleaned sink) is false" })).toBe(10);
  expect(who({ reason: "(cleaned floor) is false" })).toBeUndefined();
});

it("reads the fact out of a reason", () => {
  expect(factIn("(not (on a b)) is false")).toBe("(on a b)");
  expect(factIn("nothing at all")).toBeNull();
});

it("has what changed while a step ran", () => {
  expect(changesBetween(history, 5, 2, 3).map((change) => change.seq)).toEqual([10]);
  expect(changesBetween(history, 10, 2, 3)).toEqual([]);
});

it("marks the leaf that decides, not the whole", () => {
  const leaf = { text: "(= (tries a) 0)", truth: false };
  const inner = { text: "(not (= (tries a) 0))", truth: true, children: [leaf], decider: 0 };
  const whole = { text: "(and (p) (not (= (tries a) 0)))", truth: true, children: [{ text: "(p)", truth: true }, inner], decider: 1 };
  expect(deciding(whole)).toBe(leaf);
  expect(deciding(leaf)).toBe(leaf);
});

const lanes: PlotForm = {
  plot: "plan_7", generated: true,
  states: {
    work: {
      regions: {
        left: { states: { step_1: { about: "(a)", dynamic: ["d"], on: { done: [{ to: "step_3", when: "(p)" }] } }, step_3: { about: "(a)", dynamic: ["d"] } } },
        right: { states: { step_2: { about: "(b)", dynamic: ["d"] } } },
      },
    },
  },
};

it("finds a plan's steps in its plot, also equal ones, and its lanes", () => {
  const names = stepsOf(lanes, ["(a)", "(b)", "(a)"]);
  expect([...names]).toEqual([["step_1", 0], ["step_3", 2], ["step_2", 1]]);
  expect(lanesOf(lanes, names)).toEqual([{ name: "left", steps: [0, 2] }, { name: "right", steps: [1] }]);
  expect(conditionsInto(lanes, "step_3")).toEqual(["(p)"]);
});
