/** Trees of conditions: which leaf decided. */

import type { Explanation } from "./records";

/** The leaf that makes the whole what it is: `decider` leads there, child by child. */
export function deciding(why: Explanation): Explanation {
  const next = why.decider === undefined ? undefined : why.children?.[why.decider];
  return next ? deciding(next) : why;
}
