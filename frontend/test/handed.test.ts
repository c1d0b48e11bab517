import { expect, it } from "vitest";
import { eventIn } from "../src/core/handed";

it("reads an event with its attributes: numbers, truth values, names", () => {
  expect(eventIn(" low level=0.2 item=cup1 urgent=true ")).toEqual({ name: "low", attributes: { level: 0.2, item: "cup1", urgent: true } });
  expect(eventIn("stop")).toEqual({ name: "stop", attributes: {} });
});

it("says what is no attribute", () => {
  expect(() => eventIn("low level")).toThrow("'level' is no attribute: write name=value");
  expect(() => eventIn("low level=")).toThrow("name=value");
});
