/** How things were after a record: a pure function of the records up to it. */

import { withAction, withComponent, type Components } from "./components";
import { isWatch, withReport, withWatch, type Conditions } from "./conditions";
import { newPlan, withEnd, withOrder, withStep, type Plan } from "./plans";
import { splitPath, stepsOf, stepTexts, type PlotForm } from "./plots";
import { written, type ActionRec, type ComponentRec, type EventRec, type KnowledgeRec, type Micro, type PlanAskedRec, type PlanFoundRec, type PlanNoneRec, type PlanOrderedRec, type Rec, type StepRec, type Taken, type WorldRec } from "./records";
import type { Fact, Named, Value } from "./values";

export const TRAIL = 10;
/** Skills that search for plans. */
const SEARCHING: ReadonlySet<string> = new Set(["planner.plan", "planner.monitor"]);

export interface Since {
  readonly seq: number;
  readonly t: number;
}

export interface Trace extends Taken, Since {}

export interface Moment {
  seq: number;
  t: number;
  /** Path of an active state -> when it was entered. */
  active: Map<string, Since>;
  /** Path of a state -> hash of the plot that is its content; "" is the outermost plot. */
  bound: Map<string, string>;
  /** Path of a plot's holder -> its parameters and variables. */
  variables: Map<string, Named>;
  /** The transitions taken last, the latest first. */
  trail: readonly Trace[];
  /** Skills at work, by the seq of the record that started them. */
  working: Map<number, ActionRec>;
  components: Components;
  conditions: Conditions;
  plans: Plan[];
  /** Path of a state -> place in `plans` of the plan that is carried out in it. */
  running: Map<string, number>;
  /** The search for a plan that goes on, or that found none; a run has one planner. */
  search: PlanAskedRec | PlanNoneRec | null;
  /** The rule that may turn out to be why the plan ends. */
  trouble: number | null;
  /** The last record that said that a plan does not lead to the goal any more: it may be carried out until there is another. */
  broken: number | null;
  version: number;
  nodes: Map<string, string>;
  facts: Map<string, Fact>;
  values: Map<string, readonly Value[]>;
  /** The last record of the world as it is drawn. */
  scene: number | null;
  end: number | null;
}

export type Plots = ReadonlyMap<string, PlotForm>;

export function beginning(): Moment {
  return {
    seq: 0, t: 0, active: new Map(), bound: new Map(), variables: new Map(), trail: [],
    working: new Map(), components: new Map(), conditions: new Map(), plans: [], running: new Map(), search: null, trouble: null, broken: null, version: 0, nodes: new Map(), facts: new Map(), values: new Map(),
    scene: null, end: null,
  };
}

/** An independent moment that says the same. */
export function copyOf(moment: Moment): Moment {
  return {
    ...moment, active: new Map(moment.active), bound: new Map(moment.bound), variables: new Map(moment.variables),
    working: new Map(moment.working), components: new Map(moment.components), conditions: new Map(moment.conditions), plans: [...moment.plans], running: new Map(moment.running),
    nodes: new Map(moment.nodes), facts: new Map(moment.facts), values: new Map(moment.values),
  };
}

/** Turn the moment before a record into the one after it. */
export function advance(moment: Moment, rec: Rec, plots: Plots): void {
  moment.seq = rec.seq;
  moment.t = rec.t;
  const change = CHANGES.get(rec.type);
  if (change) change(moment, rec as never, plots);
}

type Change = (moment: Moment, rec: never, plots: Plots) => void;

/** A map: types of records are any words, `constructor` as well. */
const CHANGES: ReadonlyMap<string, Change> = new Map(Object.entries<Change>({
  step: stepped,
  world: worldBegins,
  knowledge: knowledgeChanged,
  action: acted,
  component: (moment, rec: ComponentRec) => withComponent(moment.components, rec),
  event: happened,
  scene: (moment, rec: Rec) => void (moment.scene = rec.seq),
  rule: (moment, rec: Rec) => void (moment.trouble = rec.seq),
  end: (moment, rec: Rec) => {
    moment.end = rec.seq;
    searchEnds(moment);
  },
  "plan.broken": (moment, rec: Rec) => void (moment.broken = rec.seq),
  "plan.asked": (moment, rec: PlanAskedRec) => void (moment.search = rec),
  "plan.none": (moment, rec: PlanNoneRec) => void (moment.search = rec),
  "plan.found": planFound,
  "plan.ordered": planOrdered,
  "plan.skipped": stepsSkipped,
}));

/** A skill has ended, or something came from outside. */
function happened(moment: Moment, rec: EventRec): void {
  withReport(moment.conditions, rec);
  if (rec.cause !== null && !isFlip(rec)) moment.working.delete(rec.cause);
  searchEnds(moment, rec.source);
}

function isFlip({ original, name, source }: EventRec): boolean {
  return isWatch(source) && ["became_true", "became_false"].includes(original ?? name);
}

/** Without a record of its own, a search ends with the skill that searches. */
function searchEnds(moment: Moment, skill = "planner.plan"): void {
  if (moment.search?.type === "plan.asked" && SEARCHING.has(skill)) moment.search = null;
}

/** A skill is started, waits for its component, gets it, or is cancelled since its state was left. */
function acted(moment: Moment, rec: ActionRec): void {
  withAction(moment.components, rec);
  withWatch(moment.conditions, rec);
  if (rec.action === "start") moment.working.set(rec.seq, rec);
  if (rec.action !== "wait" && rec.action !== "begin" && rec.action !== "cancel") return;
  for (const [seq, one] of moment.working) {
    if (one.id !== rec.id) continue;
    if (rec.action === "cancel") {
      moment.working.delete(seq);
      searchEnds(moment, one.skill);
    }
    else moment.working.set(seq, { ...one, for: rec.for });
  }
}

function stepped(moment: Moment, rec: StepRec, plots: Plots): void {
  for (const micro of rec.microsteps) microstepped(moment, rec, micro, plots);
  const taken = rec.microsteps.flatMap((micro) => micro.taken.map((one) => ({ ...one, seq: rec.seq, t: rec.t })));
  if (taken.length) moment.trail = [...taken.reverse(), ...moment.trail].slice(0, TRAIL);
  for (const [path, said] of Object.entries(rec.variables ?? {})) {
    moment.variables.set(path, { ...moment.variables.get(path), ...said });
  }
}

function microstepped(moment: Moment, rec: StepRec, micro: Micro, plots: Plots): void {
  for (const path of micro.exited) {
    planStepLeft(moment, rec, path, micro.taken);
    moment.active.delete(path);
    if (moment.bound.delete(path)) planLeft(moment, rec, path);
    moment.variables.delete(path);
  }
  for (const { state, plot, hash } of micro.bound ?? []) {
    moment.bound.set(state, hash);
    const form = plots.get(hash);
    if (form?.generated) planBound(moment, rec, state, plot, form);
  }
  for (const path of micro.entered) {
    moment.active.set(path, { seq: rec.seq, t: rec.t });
    changeStep(moment, path, (step) => {
      moment.trouble = null; // whatever it was, it was got over
      return { state: "running", tries: step.tries + 1, since: step.since ?? rec.t, until: null };
    });
  }
}

function planFound(moment: Moment, rec: PlanFoundRec): void {
  const asked = moment.search?.type === "plan.asked" ? moment.search.t : null;
  moment.plans.push({ ...newPlan(rec.plot, rec.seq, rec.steps, rec.engine), searched: asked === null ? null : rec.t - asked });
  moment.search = null;
}

/** What is going to be carried out: the plan found, or what is left of the one before. */
function planOrdered(moment: Moment, rec: PlanOrderedRec): void {
  const number = announced(moment, rec, rec.plot, rec.steps);
  moment.plans[number] = withOrder(moment.plans[number]!, rec.steps, rec.links ?? []);
}

/** The number of the plan of a name; a new one if nobody spoke of it. */
function announced(moment: Moment, rec: Rec, name: string, steps: readonly string[]): number {
  const number = moment.plans.findLastIndex((plan) => plan.name === name && plan.ended === null);
  return number < 0 ? moment.plans.push(newPlan(name, rec.seq, steps)) - 1 : number;
}

/** A generated plot begins to run. */
function planBound(moment: Moment, rec: Rec, at: string, name: string, form: PlotForm): void {
  const number = announced(moment, rec, name, stepTexts(form));
  const plan = moment.plans[number]!;
  const texts = plan.steps.map((step) => step.text);
  let bound: Plan = { ...plan, at, names: stepsOf(form, texts) };
  for (const [state, step] of bound.names) {
    const since = moment.active.get(`${at}/${state}`); // it runs since the plan before, and goes on in this one
    if (since) bound = withStep(bound, step, { state: "running", tries: 1, since: since.t });
  }
  moment.plans[number] = bound;
  moment.running.set(at, number);
}

function planLeft(moment: Moment, rec: Rec, path: string): void {
  const number = moment.running.get(path);
  if (number === undefined) return;
  moment.running.delete(path);
  const plan = moment.plans[number]!;
  const why = [moment.broken, moment.trouble].find((one) => one !== null && one > plan.seq);
  moment.plans[number] = withEnd(plan, why ?? rec.seq, rec.t, why === undefined);
}

function planStepLeft(moment: Moment, rec: Rec, path: string, taken: readonly Taken[]): void {
  const way = taken.find((one) => one.from === path);
  changeStep(moment, path, () => {
    const state = way === undefined ? "stopped" : way.on === "done" ? "done" : "failed";
    return { state, until: rec.t };
  });
}

function changeStep(moment: Moment, path: string, change: (step: Plan["steps"][number]) => Partial<Plan["steps"][number]>): void {
  const [holder, name] = splitPath(path);
  const number = moment.running.get(holder);
  if (number === undefined) return;
  const plan = moment.plans[number]!;
  const step = plan.names.get(name);
  if (step === undefined) return;
  moment.plans[number] = withStep(plan, step, change(plan.steps[step]!));
}

function stepsSkipped(moment: Moment, rec: Rec & { plot: string; steps: readonly string[] }): void {
  const number = moment.plans.findLastIndex((plan) => plan.name === rec.plot);
  let plan = moment.plans[number];
  if (plan === undefined) return;
  plan.steps.forEach((step, i) => {
    if (step.state === "waiting" && rec.steps.includes(step.text)) plan = withStep(plan!, i, { state: "skipped" });
  });
  moment.plans[number] = plan;
}

function worldBegins(moment: Moment, rec: WorldRec): void {
  moment.version = rec.version;
  moment.nodes = new Map(Object.entries(rec.nodes));
  moment.facts = new Map(rec.facts.map((fact) => [written(fact), fact]));
  moment.values = new Map(rec.values.map((value) => [written(value.slice(0, -1)), value]));
}

/** Removals come first. */
function knowledgeChanged(moment: Moment, rec: KnowledgeRec): void {
  moment.version = rec.version;
  for (const node of rec.removed_nodes ?? []) moment.nodes.delete(node);
  for (const fact of rec.removed ?? []) moment.facts.delete(written(fact));
  for (const [node, type] of Object.entries(rec.nodes ?? {})) moment.nodes.set(node, type);
  for (const fact of rec.added ?? []) moment.facts.set(written(fact), fact);
  for (const value of rec.values ?? []) moment.values.set(written(value.slice(0, -1)), value);
}
