import { describe, expect, it } from "vitest";
import { visible } from "../src/chart/visible";
import { History } from "../src/core/history";
import type { PlotForm } from "../src/core/plots";
import type { Rec } from "../src/core/records";
import { eventWords, stateWords } from "../src/core/words";

const plot: PlotForm = {
  plot: "tour",
  states: {
    active: {
      regions: {
        plot: { states: { walk: { use: "walk", on: { low: [{ to: "walk_low_handled" }] } }, walk_low_handled: { use: "charge", on: { then_home: [{ to: "walk" }] } } } },
        on_seen: { states: { seen_awaited: {} } },
      },
    },
  },
};
const words = {
  states: { active: "tour and its handlers", "active:on_seen": "on seen", walk_low_handled: "handles low", seen_awaited: "waits for seen" },
  events: { then_home: "then home" },
  variables: {},
};
const run: Rec[] = [
  { type: "plot", hash: "t", name: "tour", plot, words },
  { type: "step", microsteps: [{ event: null, taken: [], exited: [], entered: ["active", "walk"], bound: [{ state: "", plot: "tour", hash: "t" }] }] },
  { type: "step", microsteps: [{ event: "low", taken: [{ from: "walk", on: "low", to: "walk_low_handled" }], exited: ["walk"], entered: ["walk_low_handled"] }] },
].map((data, i) => ({ seq: i + 1, t: i, cause: null, ...data }));

describe("a handler", () => {
  const history = new History();
  history.append(1, run);

  it("is drawn as its author wrote it, with its events", () => {
    const { nodes, edges } = visible(history.at(3), history.plots, { focus: "", open: new Map(), all: new Set() });
    expect(nodes.map((node) => node.name)).toEqual(["tour and its handlers", "plot", "walk", "handles low", "on seen", "waits for seen"]);
    expect(edges.map((edge) => edge.labels)).toContainEqual(["then home"]);
  });

  it("is told so in each path of the log, as of its moment", () => {
    expect(history.words("walk_low_handled", 3)).toBe("handles low");
    expect(history.words("walk_low_handled/arm/move", 3)).toBe("handles low/arm/move");
    expect(history.words("walk_low_handled", 1)).toBe("walk_low_handled");
  });
});

describe("a reason that the program gives", () => {
  it("names a state in words", () => {
    const history = new History();
    history.append(1, run);
    const reason = "state 'walk_low_handled' does not handle 'lost' of plot 'charge'";
    expect(history.inWords(reason, 3)).toBe("state 'handles low' does not handle 'lost' of plot 'charge'");
  });
});

describe("a plan", () => {
  const plan: PlotForm = { plot: "plan_1", generated: true, states: { before: {}, step_1: { about: "(drive hall)", dynamic: ["drive"] }, after_1: {}, step_1_again: {}, finished: { final: true } } };

  it("tells its states by its steps", () => {
    const names = ["before", "step_1", "after_1", "step_1_again", "finished"];
    expect(names.map((name) => stateWords(plan, name))).toEqual(["begin", "1 drive hall", "after 1 drive hall", "again 1 drive hall", "finished"]);
    expect(stateWords({ ...plan, generated: false }, "before")).toBe("before");
  });

  it("has no words for what nobody added", () => {
    expect([stateWords(undefined, "a"), eventWords(plan, "constructor"), stateWords(plan, "constructor")]).toEqual(["a", "constructor", "constructor"]);
  });
});
