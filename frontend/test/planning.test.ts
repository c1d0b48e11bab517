import { describe, expect, it } from "vitest";
import { History } from "../src/core/history";
import type { Rec } from "../src/core/records";

function after(...said: object[]) {
  const history = new History();
  history.append(1, said.map((data, i) => ({ seq: i + 1, t: i, cause: null, ...data }) as Rec));
  return history.at(said.length);
}

const start = { type: "action", action: "start", id: "a1.0", skill: "planner.plan" };
const asked = { type: "plan.asked", goal: "(clean table)", version: 1 };
const found = { type: "plan.found", plot: "plan_1", steps: ["(wipe table)"], engine: "hand" };

describe("while the robot plans", () => {
  it("the moment has the goal", () => {
    expect(after(start, asked).search).toMatchObject({ type: "plan.asked", goal: "(clean table)", t: 1 });
  });

  it("a plan ends the search, and knows how long it took", () => {
    const { search, plans } = after(start, asked, found);
    expect([search, plans[0]!.searched]).toEqual([null, 1]);
  });

  it("the moment says that there is no plan, until it is planned anew", () => {
    const none = { type: "plan.none", kind: "unsolvable", reason: "(clean table) cannot be reached" };
    const over = { type: "event", name: "no_plan", source: "planner.plan", attributes: {}, cause: 1 };
    expect(after(start, asked, none, over).search).toMatchObject({ type: "plan.none", reason: "(clean table) cannot be reached" });
    expect(after(start, asked, none, over, asked).search?.type).toBe("plan.asked");
  });

  it("a search that is called off, whose skill fails or whose run ends is over", () => {
    const cancel = { type: "action", action: "cancel", id: "a1.0", skill: "planner.plan" };
    const failed = { type: "event", name: "skill_error", source: "planner.plan", attributes: {}, cause: 1 };
    const end = { type: "end", finished: false, problem: "it was cancelled" };
    for (const over of [cancel, failed, end]) expect(after(start, asked, over).search).toBeNull();
    expect(after(start, asked, { type: "event", name: "seen", source: "camera.look", attributes: {} }).search).not.toBeNull();
  });

  it("a plan whose search began before the first record does not say how long it took", () => {
    expect(after(found).plans[0]!.searched).toBeNull();
  });
});
