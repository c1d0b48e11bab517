/** Guards of transitions, as questions about the knowledge. */

import type { Named } from "./values";

/** The values of the variables in a guard; null if a value is unknown, or is one that the knowledge cannot read. */
export function paramsOf(text: string, values: Named): Named | null {
  const names = new Set([...text.matchAll(/\?([\w.-]+)/g)].map(([, name]) => name!));
  for (const [, bound] of text.matchAll(/\((?:exists|forall) \(([^()]*)\)/g)) for (const [, name] of bound!.matchAll(/\?([\w.-]+)/g)) names.delete(name!);
  const found = [...names].map((name) => [name, values[name]] as const);
  return found.every(([, value]) => ["string", "number", "boolean"].includes(typeof value)) ? Object.fromEntries(found) as Named : null;
}
