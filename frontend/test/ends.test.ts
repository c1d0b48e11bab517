import { describe, expect, it } from "vitest";
import { endsWell, endWords } from "../src/core/ends";
import type { EndRec } from "../src/core/records";

const end = (data: Partial<EndRec>): EndRec => ({
  seq: 9, t: 1, type: "end", cause: null, finished: true, reached: true, problem: null, reason: "the plot reached its end", programming_error: null, ...data,
});

describe("the end of a run", () => {
  it("is told in words, with its reason", () => {
    expect(endWords(end({}))).toBe("finished: the plot reached its end");
    expect(endWords(end({ reached: false, reason: "no_plan: unsolvable" }))).toBe("failed: no_plan: unsolvable");
    expect(endWords(end({ finished: false, reached: false, problem: "it was cancelled", reason: "it was cancelled" }))).toBe("ended early: it was cancelled");
    expect(endWords(end({ finished: false, reached: false, programming_error: "arm.grasp", reason: "programming error in arm.grasp" }))).toBe("failed: programming error in arm.grasp");
    expect(endWords(null)).toBe("cut off: killed or suspended before its end");
  });

  it("is read in traces of older programs", () => {
    const { seq, t, type, cause } = end({});
    expect(endWords({ seq, t, type, cause, finished: true, problem: null } as EndRec)).toBe("finished: the plot reached its end");
  });

  it("is a good one only if the run finished without a problem", () => {
    expect([end({}), end({ reached: false }), end({ finished: false, reached: false }), null].map(endsWell)).toEqual([true, false, false, false]);
  });
});
