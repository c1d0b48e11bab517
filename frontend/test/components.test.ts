/** Components at a moment, and their observed values over time. */

import { expect, test } from "vitest";
import { lineOf, type Point } from "../src/core/components";
import { History } from "../src/core/history";
import type { Rec } from "../src/core/records";

const said: [number, string, object][] = [
  [0, "component", { component: "mapper", wires: { scan: "front.echo", energy: null } }],
  [1, "action", { action: "start", id: "1", skill: "mapper.survey", arguments: {} }],
  [1, "action", { action: "switch", component: "mapper", mode: "mapping" }],
  [2, "component", { component: "camera", waits: "it needs 600 of 'memory'" }],
  [3, "observation", { component: "front", entry: "echo", value: { metres: 1, quality: 0.5 } }],
  [4, "component", { component: "mapper", wires: { scan: "rear.echo", energy: null } }],
  [5, "component", { component: "camera", waits: null }],
  [6, "observation", { component: "front", entry: "echo", value: { metres: 3, quality: 0.5 } }],
  [7, "observation", { component: "front", entry: "life", value: "alive" }],
];
const records: Rec[] = said.map(([t, type, data], i) => ({ seq: i + 1, t, type, cause: null, ...data }));

function history(): History {
  const made = new History();
  made.append(1, records);
  return made;
}

test("a moment has the wires, modes and waits of then", () => {
  const made = history();
  const { components } = made.at(5);
  expect(components.get("mapper")).toEqual({ mode: "mapping", wires: { scan: "front.echo", energy: null }, waits: null });
  expect(components.get("camera")!.waits).toBe("it needs 600 of 'memory'");
  expect(made.at(7).components.get("mapper")!.wires.scan).toBe("rear.echo");
  expect(made.at(7).components.get("camera")!.waits).toBeNull();
  expect(made.at(5).components.get("camera")!.waits).not.toBeNull();
});

test("values up to a moment are in order, the parts of a record apart", () => {
  const { observed } = history();
  expect(observed.of("front", 5).map(([entry, points]) => [entry, points.map((one) => one.value)])).toEqual([["echo.metres", [1]], ["echo.quality", [0.5]]]);
  expect(observed.of("front", 9).map(([entry]) => entry)).toEqual(["echo.metres", "echo.quality", "life"]);
  expect(observed.of("mapper", 9)).toEqual([]);
});

test("numbers are a line with steps, other values are none", () => {
  const points = (...values: Point["value"][]): Point[] => values.map((value, i) => ({ seq: i + 1, t: i, value }));
  expect(lineOf(points(0, 10, 5), 4, { width: 40, height: 10 })).toBe("M0.0 10.0H10.0V0.0H20.0V5.0H40.0");
  expect(lineOf(points("alive"), 4, { width: 40, height: 10 })).toBeNull();
  expect(lineOf(points(1, null), 4, { width: 40, height: 10 })).toBeNull();
  const many = lineOf(points(...Array.from({ length: 100_000 }, (_, i) => i)), 100_000, { width: 40, height: 10 })!;
  expect(many.length).toBeLessThan(1_000);
});
