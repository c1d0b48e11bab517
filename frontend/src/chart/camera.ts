/** Where the chart is looked at: as much as can be read around what is active, and that always. */

import { useReactFlow, useStore } from "@xyflow/react";
import { useRef } from "react";
import type { Moment } from "../core/moment";
import { useCalmEffect } from "../turn";
import { innermost } from "./drawn";
import type { Box, Layout } from "./layout";
import type { Visible } from "./visible";

/** Less is too small to read; what does not fit is followed at the other scale. */
const READABLE = 0.65;
const CLOSE = 0.8;
const MARGIN = 40;

export function useCamera(shown: Visible, layout: Layout | null, moment: Moment, follow: boolean): void {
  const flow = useReactFlow();
  const width = useStore((state) => state.width);
  const height = useStore((state) => state.height);
  const fitted = useRef("");
  const since = (id: string) => moment.active.get(id)?.seq ?? 0;
  const active = innermost(shown).sort((a, b) => since(b) - since(a)).join("\n"); // the one entered last comes first
  useCalmEffect(() => {
    if (!follow || !layout || !width || !height) return;
    const states = active.split("\n");
    const all = union(states.flatMap((id) => layout.boxes.get(id) ?? []));
    const last = layout.boxes.get(states[0]!);
    const whole = union([...layout.boxes.values()]);
    if (!whole || !all || !last) return;
    const fits = (box: Box) => Math.min(width / box.width, height / box.height) > READABLE;
    const outer = [whole, ...around(shown, layout, states[0]!)];
    const here = fits(all) ? all : last;
    const frame = outer.find((box) => fits(box) && holds(box, here));
    if (frame) {
      const name = JSON.stringify([frame, width, height]);
      if (fitted.current !== name) void flow.fitBounds(frame, { padding: 0.03, duration: 250 });
      fitted.current = name;
      return;
    }
    const { x, y, zoom } = flow.getViewport();
    const pane = { x: (MARGIN - x) / zoom, y: (MARGIN - y) / zoom, width: (width - 2 * MARGIN) / zoom, height: (height - 2 * MARGIN) / zoom };
    if (zoom < READABLE || fitted.current !== "near" || !holds(pane, here)) void flow.setCenter(...near(here, outer, width, height));
    fitted.current = "near";
    // `shown` changes with every record; the picture changes with the layout.
  }, [flow, layout, active, follow, width, height]);
}

/** What does not fit as a whole: as wide as it can be, at the height of what is active. */
function near(here: Box, outer: readonly Box[], width: number, height: number): [number, number, { zoom: number; duration: number }] {
  const room = width - MARGIN;
  const column = outer.find((box) => room / box.width > READABLE);
  const most = Math.min(room / here.width, (height - MARGIN) / here.height);
  const zoom = Math.min(most, column ? Math.min(1, room / column.width) : CLOSE);
  const middle = here.y + here.height / 2;
  if (!column) return [here.x + here.width / 2, middle, { zoom, duration: 250 }];
  const half = height / 2 / zoom - MARGIN;
  const y = Math.max(column.y + half, Math.min(middle, column.y + column.height - half));
  return [column.x + column.width / 2, y, { zoom, duration: 250 }];
}

/** The boxes around a state, the outermost first. */
function around({ nodes }: Visible, layout: Layout, id: string): Box[] {
  const parents = new Map(nodes.map((node) => [node.id, node.parent]));
  const found: Box[] = [];
  for (let at = parents.get(id) ?? null; at !== null; at = parents.get(at) ?? null) {
    const box = layout.boxes.get(at);
    if (box) found.unshift(box);
  }
  return found;
}

function holds(box: Box, inner: Box): boolean {
  return inner.x >= box.x && inner.y >= box.y && inner.x + inner.width <= box.x + box.width && inner.y + inner.height <= box.y + box.height;
}

function union(boxes: readonly Box[]): Box | null {
  if (boxes.length === 0) return null;
  const x = Math.min(...boxes.map((box) => box.x));
  const y = Math.min(...boxes.map((box) => box.y));
  return {
    x, y,
    width: Math.max(...boxes.map((box) => box.x + box.width)) - x,
    height: Math.max(...boxes.map((box) => box.y + box.height)) - y,
  };
}
