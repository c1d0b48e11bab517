/** The layout kernel in a worker of its own: it may take its time without the page standing still. */

import ELK from "elkjs/lib/elk-api.js";
import worker from "elkjs/lib/elk-worker.min.js?url";
import { layout, signature, type Layout } from "./layout";
import type { Visible } from "./visible";

const KEPT = 60;
const elk = new ELK({ workerFactory: () => new Worker(worker) });
const known = new Map<string, Layout>();

/** Layouts are kept: back in time they are there at once. */
export function knownLayout(visible: Visible): Layout | undefined {
  return known.get(signature(visible));
}

export async function layoutOf(visible: Visible): Promise<Layout> {
  const found = await layout(elk, visible);
  known.set(signature(visible), found);
  if (known.size > KEPT) known.delete(known.keys().next().value!);
  return found;
}
