import ELK from "elkjs/lib/elk.bundled.js";
import { describe, expect, it } from "vitest";
import { layout, signature } from "../src/chart/layout";
import { edgeOf, HUB, MANY, visible, type View } from "../src/chart/visible";
import { beginning, type Moment } from "../src/core/moment";
import type { PlotForm, StateForm } from "../src/core/plots";

const PLAIN: View = { focus: "", open: new Map(), all: new Set() };

function moment(bound: Record<string, string>, ...active: string[]): Moment {
  return { ...beginning(), bound: new Map(Object.entries(bound)), active: new Map(active.map((path) => [path, { seq: 1, t: 0 }])) };
}

const main: PlotForm = {
  plot: "main",
  states: {
    work: {
      states: { look: { use: "search", on: { done: [{ to: "clear" }] } }, clear: { dynamic: ["a"], goal: "(g)" } },
      on: { stop: [{ to: "ended" }], failed: [{ to: "ended" }] },
    },
    ended: { final: true },
  },
};
const search: PlotForm = { plot: "search", states: { drive: { on: { arrived: [{ to: "there" }] } }, there: { final: true } } };
const plan: PlotForm = {
  plot: "plan_1",
  generated: true,
  states: {
    step_1: { about: "(drive)", dynamic: ["d"], on: { done: [{ to: "after_1" }], slipped: [{ to: "mend" }] } },
    mend: { about: "rule: on slipped wait, then retry", use: "wait", on: { done: [{ to: "step_1" }] } },
    step_1_again: { always: [{ to: "step_1" }] },
    after_1: { always: [{ to: "finished" }] },
    finished: { final: true },
  },
};
const plots = new Map([["m", main], ["s", search], ["p", plan]]);
const ids = (shown: Moment, view: View = PLAIN) => visible(shown, plots, view).nodes.map((node) => node.id);

describe("what is to be seen", () => {
  it("is the insides of composites and of active submachines", () => {
    const shown = moment({ "": "m", look: "s" }, "work", "look", "look/drive");
    expect(ids(shown)).toEqual(["work", "look", "look/drive", "look/there", "clear", "ended"]);
    expect(visible(shown, plots, PLAIN).nodes.filter((node) => node.active).map((node) => node.id)).toEqual(["work", "look", "look/drive"]);
  });

  it("is not the insides of what was collapsed", () => {
    const shown = moment({ "": "m", look: "s" }, "work", "look", "look/drive");
    expect(ids(shown, { ...PLAIN, open: new Map([["look", false]]) })).toEqual(["work", "look", "clear", "ended"]);
    expect(ids(shown, { ...PLAIN, open: new Map([["work", false]]) })).toEqual(["work", "ended"]);
  });

  it("is one plot alone when zoomed into", () => {
    const shown = moment({ "": "m", look: "s" }, "work", "look", "look/drive");
    expect(ids(shown, { ...PLAIN, focus: "look" })).toEqual(["look/drive", "look/there"]);
  });

  it("leaves out what rules added to a generated plot, unless it is active or asked for", () => {
    const idle = moment({ "": "m", clear: "p" }, "work", "clear", "clear/step_1");
    expect(ids(idle)).not.toContain("clear/mend");
    expect(ids(idle)).not.toContain("clear/step_1_again");
    expect(visible(idle, plots, PLAIN).nodes.find((node) => node.id === "clear")?.hidden).toBe(2);
    expect(ids(moment({ "": "m", clear: "p" }, "work", "clear", "clear/mend"))).toContain("clear/mend");
    expect(ids(idle, { ...PLAIN, all: new Set(["clear"]) })).toContain("clear/mend");
  });

  it("has one edge between two states, with all its triggers", () => {
    const { edges } = visible(moment({ "": "m" }, "work"), plots, PLAIN);
    expect(edges.map((edge) => [edge.id, edge.labels])).toEqual([["work>ended", ["stop", "failed"]], ["look>clear", ["done"]]]);
    expect(edgeOf("clear/step_1", "clear/after_1")).toBe("clear/step_1>after_1");
  });

  it("is of a plot with many states only what is active, and what was opened by hand", () => {
    const group = (name: string): StateForm => ({ states: Object.fromEntries(Array.from({ length: MANY / 2 }, (_, i) => [`${name}${i}`, {}])) });
    const large = new Map([["l", { plot: "large", states: { a: group("a"), b: group("b") } } as PlotForm]]);
    const inside = (view: View) => visible(moment({ "": "l" }, "a", "a0"), large, view).nodes.map((node) => node.id).filter((id) => id.length > 1);
    expect(inside(PLAIN).every((id) => id.startsWith("a"))).toBe(true);
    expect(inside(PLAIN)).toHaveLength(MANY / 2);
    expect(inside({ ...PLAIN, open: new Map([["a", false], ["b", true]]) }).every((id) => id.startsWith("b"))).toBe(true);
  });

  it("keeps the ways out of a plan quiet", () => {
    const out: PlotForm = { plot: "p", generated: true, states: { step_1: { on: { done: [{ to: "finished" }], failed: [{ to: "replan" }] } }, finished: { final: true }, replan: { final: true } } };
    const { edges } = visible(moment({ "": "o" }), new Map([["o", out]]), PLAIN);
    expect(edges.map((edge) => [edge.to, edge.quiet])).toEqual([["finished", false], ["replan", true]]);
  });

  it("keeps ways into a hub quiet and counts them", () => {
    const many = Object.fromEntries(Array.from({ length: HUB + 1 }, (_, i) => [`s${i}`, { on: { e: [{ to: "hub" }] } }]));
    const hub: PlotForm = { plot: "hub", states: { ...many, hub: { final: true } } };
    const { nodes, edges } = visible(moment({ "": "h" }), new Map([["h", hub]]), PLAIN);
    expect(edges.every((edge) => edge.quiet)).toBe(true);
    expect(nodes.find((node) => node.id === "hub")?.ways).toBe(HUB + 1);
  });
});

describe("layout", () => {
  it("puts states inside what holds them, and siblings below each other", async () => {
    const { boxes } = await layout(new ELK(), visible(moment({ "": "m", look: "s" }, "work", "look", "look/drive"), plots, PLAIN));
    const [look, drive, clear] = [boxes.get("look")!, boxes.get("look/drive")!, boxes.get("clear")!];
    expect(drive.x).toBeGreaterThan(look.x);
    expect(drive.x + drive.width).toBeLessThan(look.x + look.width);
    expect(clear.y).toBeGreaterThanOrEqual(look.y + look.height);
  });

  it("leads each line from the border of its source to that of its target", async () => {
    const { boxes, lines } = await layout(new ELK(), visible(moment({ "": "m" }, "work"), plots, PLAIN));
    const points = lines.get("look>clear")!.points;
    expect(points[0]!.y).toBeCloseTo(boxes.get("look")!.y + boxes.get("look")!.height, 0);
    expect(points.at(-1)!.y).toBeCloseTo(boxes.get("clear")!.y, 0);
  });

  it("puts regions below each other, in their order", async () => {
    const inside = { states: { s: {}, e: { final: true } } };
    const plot: PlotForm = { plot: "o", states: { both: { regions: { one: inside, two: inside, three: inside } } } };
    const { boxes, lines } = await layout(new ELK(), visible(moment({ "": "o" }, "both"), new Map([["o", plot]]), PLAIN));
    const tops = ["one", "two", "three"].map((name) => boxes.get(`both:${name}`)!.y);
    expect(tops).toEqual([...tops].sort((a, b) => a - b));
    expect(new Set(tops).size).toBe(3);
    expect([...lines.keys()].filter((id) => !id.startsWith("\u0000"))).toEqual([]);
  });

  it("breaks the long chain of a plan into lines", async () => {
    const states: Record<string, StateForm> = {};
    for (let i = 1; i <= 20; i++) states[`step_${i}`] = { about: `(drive place${i})`, dynamic: ["d"], on: { done: [{ to: `step_${i + 1}` }] } };
    const chain: PlotForm = { plot: "plan_9", generated: true, states: { ...states, step_21: { final: true } } };
    const long = moment({ "": "m", clear: "c" }, "work", "clear", "clear/step_1");
    const { boxes } = await layout(new ELK(), visible(long, new Map([...plots, ["c", chain]]), PLAIN));
    const { width, height } = boxes.get("clear")!;
    expect(width / height).toBeLessThan(4);
  });

  it("is asked for anew only when the picture changes, not when the active states do", () => {
    const one = visible(moment({ "": "m" }, "work", "look"), plots, PLAIN);
    const other = visible(moment({ "": "m" }, "work", "clear"), plots, PLAIN);
    expect(signature(one)).toBe(signature(other));
    expect(signature(one)).not.toBe(signature(visible(moment({ "": "m" }, "work"), plots, { ...PLAIN, open: new Map([["work", false]]) })));
  });
});

describe("the gates of a plan", () => {
  const gated: PlotForm = {
    plot: "plan_2", generated: true, initial: "before",
    states: {
      before: { always: [{ to: "step_1" }] },
      step_1: { about: "(a)", dynamic: ["d"], on: { done: [{ to: "after_1" }] } },
      after_1: { always: [{ to: "step_2" }] },
      step_2: { about: "(b)", dynamic: ["d"] },
    },
  };
  const known = new Map([["g", gated]]);

  it("are passed over while nobody waits at them; the way through ends with the second transition", () => {
    const { nodes, edges } = visible(moment({ "": "g" }, "step_1"), known, PLAIN);
    expect(nodes.map((node) => node.id)).toEqual(["step_1", "step_2"]);
    expect(edges.map((edge) => [edge.id, edge.via])).toEqual([["step_1>step_2", ["after_1>step_2"]]]);
  });

  it("are there while somebody waits", () => {
    const { nodes, edges } = visible(moment({ "": "g" }, "after_1"), known, PLAIN);
    expect(nodes.map((node) => [node.id, node.kind])).toEqual([["step_1", "dynamic"], ["after_1", "gate"], ["step_2", "dynamic"]]);
    expect(edges.map((edge) => edge.id)).toEqual(["step_1>after_1", "after_1>step_2"]);
  });
});
