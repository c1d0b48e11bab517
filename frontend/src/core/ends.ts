/** How a run ended, for people. */

import type { EndRec } from "./records";

/** The verdict and its reason; `null` is a run whose records stop without an end. */
export function endWords(end: EndRec | null): string {
  if (end === null) return "cut off: killed or suspended before its end";
  return `${verdict(end)}: ${end.reason ?? end.problem ?? "the plot reached its end"}`;
}

/** Traces of older programs lack `reached`. */
function verdict({ finished, reached = finished, problem, programming_error: bug }: EndRec): string {
  if (reached && problem === null) return "finished";
  return finished || bug ? "failed" : "ended early";
}

/** Whether the run did what it was for. */
export function endsWell(end: EndRec | null): boolean {
  return end !== null && verdict(end) === "finished";
}
