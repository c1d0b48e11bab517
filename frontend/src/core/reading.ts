/** Messages as they come. Of a long run most is never looked at: what is heavy is read when somebody does. */

import type { Rec } from "./records";

/** A record of which only the beginning was read. */
interface Unread extends Rec {
  readonly line: string;
}

/** Heavy ones of which no other record's meaning depends: more than half of a run's text. */
const BEGINNING = /^\{"seq": (\d+), "t": ([^,]+), "type": "(scene|decision)", "cause": (null|\d+)/;

/** The records of a message, each on a line of its own behind a first line and before a last one. */
export function recordsIn(text: string): { from: number; records: Rec[] } {
  const lines = text.split("\n");
  const from = Number(/"from":(\d+)/.exec(lines[0]!)?.[1]);
  return { from, records: lines.slice(1, -1).map((line) => recordIn(line.endsWith(",") ? line.slice(0, -1) : line)) };
}

function recordIn(line: string): Rec {
  const [, seq, t, type, cause] = BEGINNING.exec(line) ?? [];
  if (type === undefined) return JSON.parse(line) as Rec;
  const unread: Unread = { seq: Number(seq), t: Number(t), type, cause: cause === "null" ? null : Number(cause), line };
  return unread;
}

/** The record with all that it says. */
export function whole(rec: Rec): Rec {
  return "line" in rec ? (JSON.parse((rec as Unread).line) as Rec) : rec;
}
