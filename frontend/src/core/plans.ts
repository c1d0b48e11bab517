/** Plans and how far their steps are. A plan is a value: what changes makes a new one. */

export type StepState = "waiting" | "running" | "done" | "failed" | "skipped" | "stopped";

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
  /** Path of the state in which its plot runs or ran. */
  readonly at: string | null;
  readonly names: ReadonlyMap<string, number>;
  /** The record that says why it is no longer carried out; null while it is. */
  readonly ended: number | null;
}

export function newPlan(name: string, seq: number, steps: readonly string[], links: Plan["links"] = [], engine = ""): Plan {
  const waiting = steps.map((text): PlanStep => ({ text, state: "waiting", tries: 0, since: null, until: null }));
  return { name, seq, steps: waiting, links, engine, at: null, names: new Map(), ended: null };
}

export function withStep(plan: Plan, number: number, change: Partial<PlanStep>): Plan {
  return { ...plan, steps: plan.steps.map((step, i) => (i === number ? { ...step, ...change } : step)) };
}

/** The plan is carried out no longer: what was at work is stopped. */
export function withEnd(plan: Plan, ended: number, t: number): Plan {
  const steps = plan.steps.map((step) =>
    step.state === "running" ? { ...step, state: "stopped" as const, until: t } : step,
  );
  return { ...plan, steps, ended };
}

/** The number of the step that comes next; -1 if none does. */
export function nextStep(plan: Plan): number {
  if (plan.ended !== null) return -1;
  return plan.steps.findIndex((step) => step.state === "waiting");
}

/** Whether nothing of it is left to do. */
export function isFinished(plan: Plan): boolean {
  return plan.steps.every((step) => step.state === "done" || step.state === "skipped");
}
