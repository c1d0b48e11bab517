/** Events as people write them in a line: `low level=0.2 item=cup1`. */

import type { Value } from "./values";

export interface Handed {
  readonly name: string;
  readonly attributes: Readonly<Record<string, Value>>;
}

/** Throws where an attribute has no value. */
export function eventIn(text: string): Handed {
  const [name = "", ...given] = text.trim().split(/\s+/);
  return { name, attributes: Object.fromEntries(given.map(attributeIn)) };
}

function attributeIn(text: string): [string, Value] {
  const at = text.indexOf("=");
  if (at < 1 || at === text.length - 1) throw new Error(`'${text}' is no attribute: write name=value`);
  return [text.slice(0, at), valueIn(text.slice(at + 1))];
}

/** A number or a truth value if it reads as one, else a name. */
function valueIn(text: string): Value {
  if (text === "true" || text === "false") return text === "true";
  return Number.isFinite(Number(text)) ? Number(text) : text;
}
