/** Small parts that several panes show: records by name, condition trees, tables of values. */

import { Fragment } from "react";
import { endWords } from "../core/ends";
import { written, type ActionRec, type ComponentRec, type DecisionRec, type EndRec, type EventRec, type Explanation, type KnowledgeRec, type ObservationRec, type PlotsRec, type PlanBrokenRec, type PlanAskedRec, type PlanFoundRec, type PlanNoneRec, type Rec, type RuleRec, type SceneRec, type StepRec } from "../core/records";
import type { Named } from "../core/values";
import type { Damaged } from "../core/sound";
import { isReference } from "../core/references";
import { wordsIn } from "../core/words";
import { session } from "../session";
import { Datum } from "./Datum";
import { seconds } from "./Timeline";

/** In a line; what is longer is cut: a pane would stand still over it. */
const LINE = 300;

/** Characters of a goal in a line. */
const GOAL = 60;

/** What a record says, in a line. */
export function inShort(rec: Rec): string {
  const said = session.history.inWords(inWords(rec), rec.seq);
  return said.length > LINE ? `${said.slice(0, LINE)}…` : said;
}

function inWords(rec: Rec): string {
  switch (rec.type) {
    case "event": {
      const { name, source } = rec as EventRec;
      return source === "timer" ? "the timer of a state" : `${name} from ${source}`;
    }
    case "action": {
      const { action, skill, port, value, component, mode } = rec as ActionRec;
      if (action === "wait") return `${skill} waits for ${(rec as ActionRec).for}`;
      if (action === "wire") return wired(port ?? "", (rec as ActionRec).to ?? null);
      if (action === "set") return `set ${port} to ${String(value)}`;
      return action === "switch" ? `switch ${component} to ${mode}` : `${action} ${skill ?? port}`;
    }
    case "step": {
      const taken = (rec as StepRec).microsteps.flatMap((micro) => micro.taken);
      return taken.length ? `${ending(rec, taken[0]!.from)} → ${ending(rec, taken.at(-1)!.to ?? taken.at(-1)!.from)}` : (rec as StepRec).microsteps.some((micro) => micro.entered.length) ? "the start" : "the run leaves its states";
    }
    case "component": return componentNews(rec as ComponentRec);
    case "observation": {
      const { component, entry, value: seen } = rec as ObservationRec;
      return `${component}.${entry}: ${jsonOf(seen)}`;
    }
    case "plots": return changeOfPlots(rec as PlotsRec);
    case "scene": return `${(rec as SceneRec).things.length} things`;
    case "plan.ordered": return `${(rec as PlanFoundRec).plot}, ${(rec as PlanFoundRec).steps.length} steps`;
    case "plan.asked": return `planning … ${shortGoal(rec as PlanAskedRec)}`;
    case "plan.none": return `no plan: ${(rec as PlanNoneRec).reason}`;
    case "decision": return `${inPath(rec, (rec as DecisionRec).state)}: ${(rec as DecisionRec).chosen ?? "no candidate"}`;
    case "knowledge": return `${(rec as KnowledgeRec).author}: ${news(rec as KnowledgeRec)}`;
    case "rule": return (rec as RuleRec).rule;
    case "plan.found": return `${(rec as PlanFoundRec).plot}, ${(rec as PlanFoundRec).steps.length} steps`;
    case "plan.broken": return (rec as PlanBrokenRec).reason;
    case "damaged": return (rec as Damaged).why;
    case "end": return endWords(rec as EndRec);
    default: return "";
  }
}

function componentNews({ component, wires, waits }: ComponentRec): string {
  if (wires) return Object.entries(wires).map(([port, provider]) => wired(`${component}.${port}`, provider)).join(", ");
  return waits ? `${component} waits: ${waits}` : `${component} waits no longer`;
}

function changeOfPlots({ installed = [], replaced = [], removed = [], components = [], refused }: PlotsRec): string {
  const parts = Object.entries({ installed, replaced, removed, components }).filter(([, names]) => names.length);
  const change = parts.map(([what, names]) => `${what} ${names.join(", ")}`).join("; ");
  return refused === undefined ? change : `${change}: refused, ${refused}`;
}

function wired(port: string, provider: string | null): string {
  return provider === null ? `${port} is not wired` : `${port} ← ${provider}`;
}

function shortGoal({ goal }: PlanAskedRec): string {
  return goal.length > GOAL ? `${goal.slice(0, GOAL)}…` : goal;
}

/** The last two parts of a path: enough to know it by. */
function ending(rec: Rec, path: string): string {
  return inPath(rec, path).split("/").slice(-2).join("/");
}

/** A path that a record names, in words. */
export function inPath(rec: Rec, path: string): string {
  return session.history.words(path, rec.seq);
}

function news(rec: KnowledgeRec): string {
  const said = [...(rec.removed ?? []).map((fact) => `− ${written(fact)}`), ...(rec.added ?? []).map((fact) => `+ ${written(fact)}`),
    ...(rec.values ?? []).map((value) => `${written(value.slice(0, -1))} = ${String(value.at(-1))}`)];
  return said.length > 3 ? `${said.slice(0, 3).join(" ")} and ${said.length - 3} more` : said.join(" ");
}

export function RecordLink({ rec }: { rec: Rec }) {
  return (
    <button className={`record ${/^[a-z.]{1,20}$/.test(rec.type) ? rec.type.replace(".", "-") : ""}`} onClick={() => session.goTo(rec.seq, { kind: "record", seq: rec.seq })}>
      <span className="type">{rec.type}</span>
      <span className="said"><Broken text={inShort(rec)} /></span>
      <span className="quiet">{seconds(rec.t)}</span>
    </button>
  );
}

/** Long names are broken where their parts end, if they must be. */
function Broken({ text }: { text: string }) {
  return text.split(/(?<=[/_])/).map((part, i) => <Fragment key={i}>{part}<wbr /></Fragment>);
}

/** What led to a record, back to where it began. */
export function Causes({ seq }: { seq: number }) {
  const [, ...causes] = session.history.causes(seq);
  if (causes.length === 0) return null;
  return (
    <>
      <h3>Led to by</h3>
      <ul className="records">{causes.map((rec) => <li key={rec.seq}><RecordLink rec={rec} /></li>)}</ul>
    </>
  );
}

export const TRUTH = new Map<unknown, [string, string]>([[true, ["✓", "true"]], [false, ["✕", "false"]]]);

/** A condition as a tree: each part with its truth, the one that decided marked. */
export function Tree({ why, decider }: { why: Explanation; decider: Explanation }) {
  const parts = why.children ?? [];
  const [sign, truth] = TRUTH.get(why.truth) ?? ["?", "unknown"];
  const decides = why === decider;
  const whole = why.text ?? "";
  // The parts say the rest: a long conjunction is not written out twice.
  const text = parts.length && whole.length > 60 ? `${whole.slice(0, whole.indexOf(" ") > 0 ? whole.indexOf(" ") : 20)} …)` : whole;
  return (
    <div className="tree" role="treeitem" aria-label={`${whole} is ${truth}${decides ? ", this decided" : ""}`}>
      <div className={`leaf ${truth} ${decides ? "decides" : ""}`} title={whole}>
        <span className="sign" aria-hidden="true">{sign}</span>
        <span>
          <code>{text}</code>
          {why.detail && <span className="quiet">{` ${why.detail}`}</span>}
          {decides && <span className="badge decided">decided</span>}
        </span>
      </div>
      {parts.length > 0 && <div role="group">{parts.map((part, i) => <Tree key={i} why={part} decider={decider} />)}</div>}
    </div>
  );
}

/** `words` are those of names that no author wrote. */
export function Values({ values, words }: { values: Named; words?: Readonly<Record<string, string>> | undefined }) {
  const names = Object.keys(values);
  if (names.length === 0) return null;
  return (
    <table className="values">
      <tbody>
        {names.map((name) => (
          <tr key={name}><th scope="row">{wordsIn(words, name) ?? `?${name}`}</th><td><Value value={values[name]} /></td></tr>
        ))}
      </tbody>
    </table>
  );
}

/** A value in words; data that a reference names as a picture or a plot. */
function Value({ value }: { value: unknown }) {
  return isReference(value) ? <Datum reference={value} /> : <>{shortly(value)}</>;
}

function shortly(value: unknown): string {
  if (typeof value === "string") return value;
  if (value !== null && typeof value === "object" && "plot" in value) return `the plot ${String(value.plot)}`;
  return jsonOf(value);
}

/** JSON that fits in a cell; what is nested too deeply is said to be. */
export function jsonOf(value: unknown): string {
  try {
    const text = JSON.stringify(value) ?? "";
    return text.length > CELL ? `${text.slice(0, CELL)}…` : text;
  } catch {
    return "nested too deeply";
  }
}

/** Characters in a cell. */
export const CELL = 400;

export function Facts({ title, sign, facts }: { title: string; sign: string; facts: readonly string[] }) {
  if (facts.length === 0) return null;
  return (
    <>
      {title && <h3>{title}</h3>}
      <ul className={`facts ${sign === "+" ? "" : "gone"}`}>{facts.map((fact) => <li key={fact}><code>{`${sign} ${fact}`}</code></li>)}</ul>
    </>
  );
}

export function changed(rec: KnowledgeRec): { added: string[]; removed: string[] } {
  const values = (rec.values ?? []).map((value) => `${written(value.slice(0, -1))} = ${String(value.at(-1))}`);
  return { added: [...(rec.added ?? []).map(written), ...values], removed: (rec.removed ?? []).map(written) };
}
