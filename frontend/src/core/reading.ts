/** Messages as they come. Of a long run most is never looked at: what is heavy is read when somebody does. */

import type { Rec } from "./records";
import { damaged, sound } from "./sound";

/** A record of which only the beginning was read. */
interface Unread extends Rec {
  readonly line: string;
}

/** Heavy ones of which no other record's meaning depends: more than half of a run's text. */
const BEGINNING = /^\{"seq": (\d+), "t": (-?\d[^,]*), "type": "(scene|decision)", "cause": (null|\d+)/;
/** Texts, so that they are passed over, and numbers that JSON lacks. */
const NO_JSON = /"[^"\\]*(?:\\.[^"\\]*)*"|-?Infinity|NaN/g;

/** The records of a message, each on a line of its own behind a first line and before a last one. */
export function recordsIn(text: string): { from: number; records: Rec[] } {
  const lines = text.split("\n");
  const from = Number(/"from":(\d+)/.exec(lines[0]!)?.[1]);
  return { from, records: lines.slice(1, -1).map((line, i) => recordIn(line.endsWith(",") ? line.slice(0, -1) : line, from + i)) };
}

function recordIn(line: string, number: number): Rec {
  const [, seq, t, type, cause] = BEGINNING.exec(line) ?? [];
  if (type === undefined || !line.endsWith("}")) return wholeIn(line, number);
  const unread: Unread = { seq: Number(seq), t: Number(t), type, cause: cause === "null" ? null : Number(cause), line };
  return unread.seq === number && Number.isFinite(unread.t) && (unread.cause ?? 0) < number ? unread : wholeIn(line, number);
}

function wholeIn(line: string, number: number): Rec {
  try {
    return sound(parsed(line), number);
  } catch (error) {
    return damaged(number, `it is no JSON (${(error as Error).message.replace(/ \(line 1 column \d+\)$/, "").slice(0, 120)})`, line);
  }
}

/** The record with all that it says. */
export function whole(rec: Rec): Rec {
  if (rec.type === "damaged" || !("line" in rec)) return rec;
  const found = wholeIn((rec as Unread).line, rec.seq);
  return found.type === "damaged" ? { ...found, t: rec.t } : found;
}

/** JSON as the program writes it: also with numbers that JSON lacks; throws for what is no JSON. */
export function parsed(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch (error) {
    const plain = text.replace(NO_JSON, (part) =>
      part.startsWith('"') ? part : part === "NaN" ? "null" : part.replace("Infinity", "1e999"));
    if (plain === text) throw error;
    return JSON.parse(plain);
  }
}
