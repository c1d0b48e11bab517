/** Trees of conditions: which leaf decided. */

import type { Candidate, Explanation } from "./records";

export function partsOf(why: Explanation): readonly Explanation[] {
  return why.children ?? why.parts ?? [];
}

/** The leaf of a candidate's condition that its reason names. */
export function deciding(candidate: Candidate): Explanation | null {
  return found(candidate.condition, (one) => partsOf(one).length === 0 && says(candidate.reason, one.text))
    ?? found(candidate.condition, (one) => says(candidate.reason, one.text));
}

function says(reason: string, text: string | undefined): boolean {
  return text !== undefined && reason.startsWith(`${text} is `);
}

function found(why: Explanation, is: (one: Explanation) => boolean): Explanation | null {
  for (const part of partsOf(why)) {
    const inside = found(part, is);
    if (inside) return inside;
  }
  return is(why) ? why : null;
}
