/** The layout kernel in a worker of its own: it may take its time without the page standing still. */

import ELK from "elkjs/lib/elk-api.js";
import worker from "elkjs/lib/elk-worker.min.js?url";
import { layout, signature, type Layout } from "./layout";
import type { Visible } from "./visible";

const KEPT = 60;
const elk = new ELK({ workerFactory: () => new Worker(worker) });
const known = new Map<string, Layout>();
let working: Promise<unknown> = Promise.resolve();
let asked: Visible | null = null;

/** Layouts are kept: back in time they are there at once. */
export function knownLayout(visible: Visible): Layout | undefined {
  return known.get(signature(visible));
}

/** One after the other: who asks while another is worked on gets nothing if somebody asks for yet another meanwhile. */
export async function layoutOf(visible: Visible): Promise<Layout | null> {
  asked = visible;
  await working;
  if (asked !== visible) return null;
  const found = layout(elk, visible);
  working = found.catch(() => undefined);
  const made = await found;
  known.set(signature(visible), made);
  if (known.size > KEPT) known.delete(known.keys().next().value!);
  return made;
}
