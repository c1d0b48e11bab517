/** References to data outside of the trace, such as `data:9f86d081884c7d65.png`. */

const REFERENCE = /^data:([0-9a-f]{16}\.[a-z0-9]{1,8})$/;

/** The most references of one record that are shown. */
const MOST = 12;

export function isReference(value: unknown): value is string {
  return typeof value === "string" && REFERENCE.test(value);
}

/** The name of the file of a reference. */
export function fileName(reference: string): string {
  return REFERENCE.exec(reference)?.[1] ?? "";
}

/** The references in a record, at any depth, without repetitions. */
export function referencesIn(value: unknown): readonly string[] {
  const found = new Set<string>();
  const agenda: unknown[] = [value];
  while (agenda.length > 0 && found.size < MOST) {
    const one = agenda.pop();
    if (isReference(one)) found.add(one);
    else if (one !== null && typeof one === "object") agenda.push(...Object.values(one).reverse());
  }
  return [...found];
}
