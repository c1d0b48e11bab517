/** Plans and how far their steps are. A plan is a value: what changes makes a new one. */

export type StepState = "waiting" | "running" | "done" | "failed" | "skipped" | "stopped";

export const SIGNS: Readonly<Record<StepState, string>> = { waiting: "·", running: "▶", done: "✓", failed: "✕", skipped: "»", stopped: "■" };

export interface PlanStep {
  readonly text: string;
  readonly state: StepState;
  /** How often it was begun. */
  readonly tries: number;
  readonly since: number | null;
  readonly until: number | null;
}

export interface Plan {
  readonly name: string;
  /** The record that announced it. */
  readonly seq: number;
  readonly steps: readonly PlanStep[];
  readonly links: readonly (readonly [number, string, number])[];
  readonly engine: string;
  /** Seconds of run time of its search; null if no record says when it began. */
  readonly searched: number | null;
  /** Path of the state in which its plot runs or ran. */
  readonly at: string | null;
  readonly names: ReadonlyMap<string, number>;
  /** The record that says why it is no longer carried out; null while it is. */
  readonly ended: number | null;
  /** Whether its state was left although nothing had failed, e.g. for a handler. */
  readonly interrupted: boolean;
}

export function newPlan(name: string, seq: number, steps: readonly string[], engine = ""): Plan {
  return { name, seq, steps: waiting(steps), links: [], engine, searched: null, at: null, names: new Map(), ended: null, interrupted: false };
}

/** The plan as it is going to be carried out: of the one found, what was done meanwhile is left out. */
export function withOrder(plan: Plan, steps: readonly string[], links: Plan["links"]): Plan {
  return { ...plan, steps: waiting(steps), links };
}

function waiting(steps: readonly string[]): PlanStep[] {
  return steps.map((text) => ({ text, state: "waiting", tries: 0, since: null, until: null }));
}

export function withStep(plan: Plan, number: number, change: Partial<PlanStep>): Plan {
  return { ...plan, steps: plan.steps.map((step, i) => (i === number ? { ...step, ...change } : step)) };
}

/** The plan is carried out no longer: what was at work is stopped. */
export function withEnd(plan: Plan, ended: number, t: number, interrupted = false): Plan {
  const steps = plan.steps.map((step) =>
    step.state === "running" ? { ...step, state: "stopped" as const, until: t } : step,
  );
  return { ...plan, steps, ended, interrupted };
}

/** Of these steps, in their order, the number of the one that comes next; undefined if none does. */
export function nextOf(plan: Plan, which: readonly number[]): number | undefined {
  return plan.ended === null ? which.find((i) => plan.steps[i]!.state === "waiting") : undefined;
}

/** What a step is to another one: it provides for it, or relies on it. */
export function kinOf(plan: Plan, step: number, other: number): "provider" | "user" | null {
  const linked = (from: number, to: number) => plan.links.some(([provider, , user]) => provider === from + 1 && user === to + 1);
  return linked(step, other) ? "provider" : linked(other, step) ? "user" : null;
}

/** Whether nothing of it is left to do. */
export function isFinished(plan: Plan): boolean {
  return plan.steps.every((step) => step.state === "done" || step.state === "skipped");
}

/** How it ended, for people; empty while it is carried out. */
export function endOf(plan: Plan): "" | "carried out" | "interrupted" | "given up" {
  if (plan.ended === null) return "";
  if (isFinished(plan)) return "carried out";
  return plan.interrupted ? "interrupted" : "given up";
}
