/** Records that are damaged, odd, or named like what every object has: the rest is shown, and what is wrong is said. */

import ELK from "elkjs/lib/elk.bundled.js";
import { describe, expect, it } from "vitest";
import { layout } from "../src/chart/layout";
import { visible } from "../src/chart/visible";
import { eventIn } from "../src/core/handed";
import { History } from "../src/core/history";
import { parsed, recordsIn } from "../src/core/reading";
import type { Rec } from "../src/core/records";
import { isDamaged } from "../src/core/sound";
import { escaped } from "../src/picture/sheet";
import { run } from "./run";

/** Python's way of writing records: a blank after each colon and comma of the beginning. */
const lineOf = ({ seq, t, type, cause, ...rest }: Rec) =>
  `{"seq": ${seq}, "t": ${t}, "type": ${JSON.stringify(type)}, "cause": ${cause}${Object.keys(rest).length ? `, ${JSON.stringify(rest).slice(1)}` : "}"}`;
const message = (lines: readonly string[], from = 1) => `{"type":"records","from":${from},"records":[\n${lines.join(",\n")}\n]}`;
const read = (lines: readonly string[]) => {
  const made = new History();
  const { from, records } = recordsIn(message(lines));
  made.append(from, records);
  return made;
};
const sound = run.map(lineOf);
const replaced = (seq: number, line: string) => sound.map((one, i) => (i === seq - 1 ? line : one));
const head = (seq: number, type: string, rest: string, t = "1.0") => `{"seq": ${seq}, "t": ${t}, "type": "${type}", "cause": null${rest}}`;

/** What every object has. */
const INHERITED = ["constructor", "__proto__", "toString", "hasOwnProperty", "valueOf", "__defineGetter__", "prototype"];

describe("a damaged record", () => {
  const damages: [string, string, string][] = [
    ["no JSON", '{"seq": 10, "t": 3, "type": "knowledge", "cause": null, "ver}', "no JSON"],
    ["nothing", "", "no JSON"],
    ["noise", "\u0000\u0007", "no JSON"],
    ["no object", "[10]", "no object"],
    ["null", "null", "no object"],
    ["deep arrays", "[".repeat(100_000), "no JSON"],
    ["another number", head(9, "knowledge", ""), "record 9"],
    ["a later number", head(99, "scene", ', "things": []'), "record 99"],
    ["a text for a number", '{"seq": "10", "t": 1.0, "type": "log", "cause": null}', 'record "10"'],
    ["no time", '{"seq": 10, "type": "log", "cause": null}', "'t' is no number"],
    ["no such time", head(10, "log", "", "NaN"), "'t' is no number"],
    ["an endless time", head(10, "log", "", "Infinity"), "'t' is no number"],
    ["an endless time of a scene", head(10, "scene", ', "things": []', "1e999"), "'t' is no number"],
    ["no type", '{"seq": 10, "t": 1.0, "cause": null}', "'type' is no text"],
    ["a cause to come", '{"seq": 10, "t": 1.0, "type": "log", "cause": 12}', "'cause'"],
    ["itself as a cause", '{"seq": 10, "t": 1.0, "type": "scene", "cause": 10, "things": []}', "'cause'"],
    ["a cause that is no number", '{"seq": 10, "t": 1.0, "type": "log", "cause": "9"}', "'cause'"],
    ["no microsteps", head(10, "step", ""), "'microsteps'"],
    ["microsteps of another kind", head(10, "step", ', "microsteps": [null]'), "'microsteps'"],
    ["inherited microsteps", head(10, "step", ', "__proto__": {"microsteps": []}'), "'microsteps'"],
    ["variables of another kind", head(10, "step", ', "microsteps": [], "variables": [1]'), "'variables'"],
    ["facts of another kind", head(10, "knowledge", ', "version": 2, "author": "x", "added": [[]]'), "'added'"],
    ["an object as an argument", head(10, "knowledge", ', "version": 2, "author": "x", "added": [["on", {}]]'), "'added'"],
    ["no states", head(10, "plot", ', "hash": "x", "plot": {"plot": "x"}'), "'plot'"],
    ["states within states without end", head(10, "plot", `, "hash": "x", "plot": {"plot": "x", "states": ${'{"a": {"states": '.repeat(500)}{}${"}}".repeat(500)}}`), "'plot'"],
    ["a state inside itself", head(10, "plot", ', "hash": "x", "plot": {"plot": "x", "states": {"a": {"states": {"b": {"states": {"a": {}}}}}}}'), "'plot'"],
    ["a state called as a path", head(10, "plot", ', "hash": "x", "plot": {"plot": "x", "states": {"a/b": {}}}'), "'plot'"],
    ["ways of another kind", head(10, "plot", ', "hash": "x", "plot": {"plot": "x", "states": {"a": {"on": {"e": "b"}}}}'), "'plot'"],
    ["steps of another kind", head(10, "plan.found", ', "plot": "p", "steps": [7]'), "'steps'"],
    ["links of another kind", head(10, "plan.ordered", ', "plot": "p", "steps": [], "links": [[-1, "x", 0.5]]'), "'links'"],
  ];

  it.each(damages)("with %s is named, and the rest is shown", (_, line, why) => {
    const made = read(replaced(10, line));
    const [damage, ...more] = made.damages;
    expect(more).toEqual([]);
    expect(made.last).toBe(run.length);
    expect(damage).toMatchObject({ seq: 10, line: 11, type: "damaged", cause: null, t: run[8]!.t });
    expect(damage!.why).toContain(why);
    expect(made.marks.failure).toContain(10);
    expect(made.at(run.length).plans.map((plan) => plan.name)).toEqual(["plan_1", "plan_2"]);
  });

  it.each([["scene", "things", "[{}]"], ["scene", "things", '[{"id": "a", "shape": "b", "x": "a", "y": 0, "label": ""}]'], ["decision", "candidates", "7"],
    ["decision", "candidates", '[{"plot": "a", "condition": {"children": [3]}}]'], ["scene", "things", "[}"]])(
    "that is only read when somebody looks is named then: %s %s %s", (type, name, value) => {
      const made = read(replaced(10, head(10, type, `, "${name}": ${value}`)));
      expect(made.damages).toEqual([]);
      expect(isDamaged(made.record(10)!)).toBe(true);
      expect(made.record(10)!.t).toBe(1);
      expect(made.damages.map((one) => one.seq)).toEqual([10]);
    });

  it("that makes no sense after those before it changes nothing, forwards and backwards", () => {
    const made = new History();
    made.append(1, [...run.slice(0, 4), { seq: 5, t: 1, type: "step", cause: null } as Rec, ...run.slice(5)]);
    expect(made.damages.map((one) => one.seq)).toEqual([5]);
    const [forwards, backwards] = [made.at(made.last), made.at(5)];
    expect(backwards).toEqual({ ...made.at(4), seq: 5, t: 1 });
    expect(forwards.seq).toBe(run.length);
  });

  it("at each place of a run leaves the rest to be shown", () => {
    for (let seq = 1; seq <= run.length; seq++) {
      const made = read(replaced(seq, "{"));
      expect(made.damages.map((one) => one.seq)).toEqual([seq]);
      for (let at = 0; at <= made.last; at++) expect(made.at(at).seq).toBe(at);
    }
  });

  it("is told by the program as well", () => {
    const line = '{"seq": 10, "t": 3, "type": "damaged", "cause": null, "line": 12, "why": "it has bytes that are no UTF-8", "text": "{"}';
    expect(read(replaced(10, line)).damages).toEqual([JSON.parse(line)]);
  });
});

describe("a name that every object has", () => {
  it.each(INHERITED)("as a type of records is one: %s", (name) => {
    const made = read([...sound, head(run.length + 1, name, "")]);
    expect(made.damages).toEqual([]);
    expect(made.last).toBe(run.length + 1);
    expect(made.at(made.last)).toEqual({ ...made.at(run.length), seq: made.last, t: 1 });
  });

  it.each(INHERITED)("as state, plot, event, variable, thing and predicate is one: %s", async (name) => {
    const plot = `{"plot": "${name}", "states": {"${name}": {"on": {"${name}": [{"to": "b"}]}}, "b": {"states": {"c": {}}, "about": "${name}"}}}`;
    const made = read([
      head(1, "world", `, "version": 1, "nodes": {"${name}": "${name}"}, "facts": [["${name}", "${name}"]], "values": [["${name}", 1]]`),
      head(2, "plot", `, "name": "${name}", "hash": "${name}", "plot": ${plot}`),
      head(3, "step", `, "variables": {"": {"${name}": 1}, "${name}": {"${name}": 2}}, "microsteps": [{"event": "${name}", "taken": [], "exited": [], "entered": ["${name}"], "bound": [{"state": "", "plot": "${name}", "hash": "${name}"}]}]`),
      head(4, "plan.found", `, "plot": "${name}", "steps": ["${name}"]`),
      head(5, "action", `, "action": "start", "id": "${name}", "skill": "${name}", "arguments": {"${name}": "${name}"}`),
      head(6, "knowledge", `, "version": 2, "author": "${name}", "nodes": {"other": "${name}"}, "added": [["${name}", "other"]]`),
      head(7, "scene", `, "things": [{"id": "${name}", "shape": "${name}", "x": 0, "y": 0, "label": "${name}", "in": "${name}"}]`),
    ]);
    expect(made.damages).toEqual([]);
    const moment = made.at(7);
    expect([...moment.active.keys()]).toEqual([name]);
    expect([...moment.nodes]).toEqual([[name, name], ["other", name]]);
    expect([...moment.facts.keys()]).toEqual([`(${name} ${name})`, `(${name} other)`]);
    expect(Object.keys(moment.variables.get("")!)).toEqual([name]);
    expect(Object.entries(moment.variables.get(name)!)).toEqual([[name, 2]]);
    expect(moment.plans.map((plan) => plan.steps[0]!.text)).toEqual([name]);
    expect(isDamaged(made.record(7)!)).toBe(false);
    const shown = visible(moment, made.plots, { focus: "", open: new Map(), all: new Set() });
    expect(shown.nodes.map((node) => node.id)).toEqual([name, "b", "c"]);
    const { boxes, lines } = await layout(new ELK(), shown);
    expect([...boxes.keys()].sort()).toEqual([name, "b", "c"].sort());
    expect([...lines.keys()]).toEqual([`${name}>b`]);
  });

  it.each(INHERITED)("as an attribute that is handed in is one: %s", (name) => {
    expect(JSON.parse(JSON.stringify(eventIn(`go ${name}=1`).attributes))).toEqual(JSON.parse(`{"${name}": 1}`));
  });
});

describe("an odd record", () => {
  it("of a type that nobody knows, with causes in a circle, is kept", () => {
    const made = new History();
    made.append(1, [{ seq: 1, t: 0, type: "a", cause: 2 }, { seq: 2, t: 0, type: "b", cause: 1 }]);
    expect(made.causes(1).map((rec) => rec.seq)).toEqual([1, 2]);
  });

  it("with numbers that JSON lacks is read", () => {
    expect(parsed('{"a": NaN, "b": Infinity, "c": -Infinity, "d": "NaN, \\"Infinity\\""}')).toEqual({ a: null, b: Infinity, c: -Infinity, d: 'NaN, "Infinity"' });
    expect(() => parsed('{"a": Nan}')).toThrow();
    const made = read([head(1, "knowledge", ', "version": 1, "author": "x", "values": [["weight", "cup", Infinity]]')]);
    expect([made.damages, made.at(1).values.get("(weight cup)")]).toEqual([[], ["weight", "cup", Infinity]]);
  });

  it("with a geometry as the value of a function is whole", () => {
    const values = '"values": [["position", "hall", [3.5, 1]], ["position", "door", []], ["label", "hall", "hall"]]';
    const made = read([
      head(1, "world", `, "version": 1, "nodes": {"hall": "place", "door": "place"}, "facts": [], ${values}`),
      head(2, "knowledge", ', "version": 2, "author": "x", "values": [["position", "hall", [1, 2]]]'),
      head(3, "knowledge", ', "version": 3, "author": "x", "values": [["position", [1, 2], 3]]'),
      head(4, "knowledge", ', "version": 4, "author": "x", "values": [["position", "hall", ["a"]]]'),
    ]);
    expect(made.at(2).values.get("(position hall)")).toEqual(["position", "hall", [1, 2]]);
    expect(made.damages.map((rec) => rec.seq)).toEqual([3, 4]);
  });

  it("with times that go back, equal times and long texts is kept", () => {
    const made = read([3, 1, 1, 0].map((t, i) => head(i + 1, "log", `, "text": "${"x".repeat(100_000)}<script>\u202e"`, String(t))));
    expect([made.last, made.damages]).toEqual([4, []]);
    expect(made.at(4).t).toBe(0);
  });

  it("has a text in a drawing that XML can have", () => {
    expect(escaped('<a&"\u0000\u001b\ud800>🤖')).toBe("&lt;a&amp;&quot;\ufffd\ufffd\ufffd&gt;🤖");
  });
});
