import { expect, test } from "vitest";
import { MOST_PAST, withReport, withWatch, type Conditions } from "../src/core/conditions";
import { History } from "../src/core/history";
import type { ActionRec, EventRec, Rec } from "../src/core/records";

const start = (seq: number, t: number, condition = "(> a.b.c 1)"): ActionRec =>
  ({ seq, t, type: "action", cause: null, action: "start", id: `a${seq}`, skill: "conditions.watch_truth", arguments: { condition } });
const cancel = (seq: number, t: number, of: number): ActionRec =>
  ({ seq, t, type: "action", cause: null, action: "cancel", id: `a${of}`, skill: "conditions.watch_truth" });
const report = (seq: number, t: number, cause: number, name: string, parts = {}, original?: string): EventRec =>
  ({ seq, t, type: "event", cause, name, source: "conditions.watch_truth", attributes: { values: {}, parts }, ...(original && { original }) });

test("a condition has its truth, its parts and its reports", () => {
  const history = new History();
  const parts = { "(wanted)": true, "(> a.b.c 1)": null };
  history.append(1, [start(1, 0), report(2, 1, 1, "far", {}, "became_false"), report(3, 2, 1, "became_true", parts), cancel(4, 5, 1)] as Rec[]);
  expect(history.at(1).conditions.get(1)).toMatchObject({ truth: null, flips: 0, last: null, ended: null });
  expect(history.at(2).conditions.get(1)).toMatchObject({ truth: false, flips: 1, last: 1 });
  expect(history.at(3).conditions.get(1)).toMatchObject({ truth: true, parts, flips: 2, last: 2, since: 0 });
  expect(history.at(3).working.has(1)).toBe(true);
  expect(history.at(4).conditions.get(1)).toMatchObject({ truth: true, ended: 5 });
  expect(history.at(2).conditions.get(1)!.ended).toBeNull();
});

test("a failure ends a condition, and other skills are none", () => {
  const found: Conditions = new Map();
  withWatch(found, start(1, 0));
  withWatch(found, { ...start(2, 0), skill: "arm.grasp" });
  withReport(found, report(3, 4, 1, "programming_error"));
  withReport(found, report(4, 4, 2, "became_true"));
  expect([...found].map(([seq, one]) => [seq, one.truth, one.ended])).toEqual([[1, null, 4]]);
});

test("the latest past conditions are kept", () => {
  const found: Conditions = new Map();
  for (let n = 1; n <= MOST_PAST + 20; n++) {
    withWatch(found, start(n, n));
    withWatch(found, cancel(1000 + n, n, n));
  }
  expect([...found.keys()]).toEqual(Array.from({ length: MOST_PAST }, (_, i) => i + 21));
});

test("records that are not as they should be change nothing", () => {
  const found: Conditions = new Map();
  withWatch(found, { ...start(1, 0), arguments: { condition: 5 } });
  expect(found.size).toBe(0);
  withWatch(found, start(2, 0));
  withReport(found, { ...report(3, 1, 2, "became_true"), attributes: { parts: [1] } });
  expect(found.get(2)!.parts).toEqual({});
});
