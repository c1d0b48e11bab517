import { expect, test } from "vitest";
import { fileName, isReference, referencesIn } from "../src/core/references";
import { pointsOf } from "../src/panes/Datum";

const PICTURE = "data:9f86d081884c7d65.png";
const SCAN = "data:0123456789abcdef.json";

test("only whole references are references", () => {
  expect(isReference(PICTURE)).toBe(true);
  for (const other of ["data:image/png;base64,AAAA", `${PICTURE}/..`, "9f86d081884c7d65.png", 5, null]) expect(isReference(other)).toBe(false);
  expect(fileName(PICTURE)).toBe("9f86d081884c7d65.png");
});

test("references are found at any depth, once each", () => {
  expect(referencesIn({ seq: 1, attributes: { picture: PICTURE, scans: [SCAN, { again: PICTURE }] }, why: null })).toEqual([PICTURE, SCAN]);
  expect(referencesIn({ seq: 1 })).toEqual([]);
});

test("a plot spans its box, also for equal numbers", () => {
  expect(pointsOf([0, 1, 2])).toBe("0.0,58.0 120.0,30.0 240.0,2.0");
  expect(pointsOf([5, 5])).toBe("0.0,58.0 240.0,58.0");
});
