/** The plans of a moment as a drawing: the last one step by step, what each is at, those before it in a line. */

import { endOf, nextOf, SIGNS, type Plan, type StepState } from "../core/plans";
import { INK, text, type Part } from "./sheet";

const WIDTH = 330;
const LINE = 19;
const EARLIER = 6;
const COLOURS: Readonly<Record<StepState, string>> = {
  waiting: INK.quiet, running: INK.blue, done: INK.green, failed: INK.red, skipped: INK.quiet, stopped: INK.red,
};

export function planPart(plans: readonly Plan[]): Part {
  const last = plans.at(-1);
  if (!last) return { width: 0, height: 0, body: "" };
  const next = nextOf(last, last.steps.map((_, i) => i));
  const rows = [(y: number) => head(last, y), ...last.steps.map((_, i) => (y: number) => step(last, i, i === next, y)),
    ...plans.slice(-1 - EARLIER, -1).reverse().map((plan) => (y: number) => head(plan, y))];
  return { width: WIDTH, height: rows.length * LINE, body: rows.map((row, i) => row((i + 1) * LINE - 5)).join("\n") };
}

function head(plan: Plan, y: number): string {
  const done = plan.steps.filter((one) => one.state === "done").length;
  const end = endOf(plan);
  return text(`${plan.name}: ${done} of ${plan.steps.length} done${end && `, ${end}`}`, 0, y, WIDTH, plan.ended === null ? "bold" : "small");
}

function step(plan: Plan, number: number, next: boolean, y: number): string {
  const { text: said, state } = plan.steps[number]!;
  const mark = state === "running" ? `<rect x="0" y="${y - 14}" width="${WIDTH}" height="${LINE}" rx="4" fill="${INK.soft}"/>` : "";
  return `${mark}<text x="6" y="${y}" style="fill:${COLOURS[state]}">${next ? "›" : SIGNS[state]}</text>`
    + text(`${number + 1} ${said.slice(1, -1)}`, 24, y, WIDTH - 28, state === "running" ? "bold" : "");
}
