import { expect, test } from "vitest";
import { paramsOf } from "../src/core/guards";

test("a guard is asked with the values of its variables", () => {
  const values = { least: 20, cup: "cup1", list: [1] };
  expect(paramsOf("(>= (battery) ?least)", values)).toEqual({ least: 20 });
  expect(paramsOf("(open door1)", values)).toEqual({});
  expect(paramsOf("(exists (?x - cup ?y) (and (on ?x ?y) (= ?x ?cup)))", values)).toEqual({ cup: "cup1" });
});

test("a guard with an event's value, a list or an unknown variable is not asked", () => {
  for (const text of ["(= ?event.item cup1)", "(in a ?list)", "(> ?other 1)"]) expect(paramsOf(text, { list: [1] })).toBeNull();
});
