/** Visible states and their places as React Flow's nodes and edges. */

import type { Moment, Trace } from "../core/moment";
import type { Plan, StepState } from "../core/plans";
import { joinPath, splitPath } from "../core/plots";
import type { Box, Layout, Point } from "./layout";
import type { StateData, StateNodeType } from "./StateNode";
import { edgeOf, type ChartEdge, type ChartNode, type Visible } from "./visible";
import type { WayEdgeType } from "./WayEdge";

export type Acts = Pick<StateData, "select" | "toggle" | "zoom" | "showAll">;

export function drawnNodes({ nodes }: Visible, layout: Layout, moment: Moment, chosen: string | null, acts: Acts): StateNodeType[] {
  const depths = depthsOf(nodes);
  const progress = progressOf(moment.plans);
  const left = new Map<string, number>();
  trailOf(moment).forEach((one, age) => left.set(one.from, Math.min(age, left.get(one.from) ?? age)));
  return nodes.flatMap((node) => {
    const box = layout.boxes.get(node.id);
    if (!box) return [];
    const data = { node, chosen: node.id === chosen, left: left.get(node.id) ?? null, progress: progress.get(node.id) ?? null, ...acts };
    return [{
      id: node.id, type: "state" as const, position: { x: box.x, y: box.y }, data, zIndex: 2 * depths.get(node.id)!,
      width: box.width, height: box.height, style: { width: box.width, height: box.height, pointerEvents: "all" as const },
      draggable: false, selectable: false, focusable: false, connectable: false,
    }];
  });
}

export function drawnEdges({ nodes, edges }: Visible, layout: Layout, moment: Moment, chosen: string | null): WayEdgeType[] {
  const depths = depthsOf(nodes);
  const ages = new Map<string, number>();
  trailOf(moment).forEach((one, age) => {
    if (one.to === null) return;
    const id = edgeOf(one.from, one.to);
    ages.set(id, Math.min(age, ages.get(id) ?? age));
  });
  return edges.flatMap((edge) => {
    const age = edge.via.reduce<number | null>((least, one) => least ?? ages.get(one) ?? null, null);
    const line = edge.quiet ? asked(edge, age, chosen) && direct(edge, layout) : layout.lines.get(edge.id);
    if (!line || line.points.length === 0) return [];
    return [{
      id: edge.id, type: "way" as const, source: edge.from, target: edge.to, zIndex: 2 * (depths.get(edge.from) ?? 0) - 1,
      data: { edge, points: line.points, label: line.label, age }, focusable: false, selectable: false,
    }];
  });
}

/** What was taken in plots that still run: another plan may have states of the same names. */
function trailOf({ trail, active }: Moment): Trace[] {
  return trail.filter(({ from, seq }) => {
    const [holder] = splitPath(from);
    return holder === "" || (active.get(holder)?.seq ?? Infinity) <= seq;
  });
}

/** How far the steps of the plans are that run now, by path of their states. */
function progressOf(plans: readonly Plan[]): Map<string, StepState> {
  const found = new Map<string, StepState>();
  for (const plan of plans) {
    if (plan.ended !== null || plan.at === null) continue;
    for (const [name, step] of plan.names) found.set(joinPath(plan.at, name), plan.steps[step]?.state ?? "waiting");
  }
  return found;
}

function asked(edge: ChartEdge, age: number | null, chosen: string | null): boolean {
  return age !== null || edge.from === chosen || edge.to === chosen;
}

function direct(edge: ChartEdge, layout: Layout): { points: Point[]; label: null } | null {
  const [from, to] = [layout.boxes.get(edge.from), layout.boxes.get(edge.to)];
  return from && to ? { points: [border(from, to), border(to, from)], label: null } : null;
}

/** Where the line between the middles of two boxes leaves the first. */
function border(box: Box, other: Box): Point {
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const [dx, dy] = [other.x + other.width / 2 - x, other.y + other.height / 2 - y];
  const part = Math.min(box.width / 2 / (Math.abs(dx) || 1e-9), box.height / 2 / (Math.abs(dy) || 1e-9), 0.5);
  return { x: x + dx * part, y: y + dy * part };
}

export function depthsOf(nodes: readonly ChartNode[]): Map<string, number> {
  const depths = new Map<string, number>();
  for (const node of nodes) depths.set(node.id, node.parent === null ? 1 : (depths.get(node.parent) ?? 0) + 1);
  return depths;
}

/** The innermost active states. */
export function innermost({ nodes }: Visible): string[] {
  const around = new Set<string>();
  const parents = new Map(nodes.map((node) => [node.id, node.parent]));
  for (const node of nodes) {
    if (!node.active) continue;
    for (let at = node.parent; at; at = parents.get(at) ?? null) around.add(at);
  }
  return nodes.filter((node) => node.active && !around.has(node.id)).map((node) => node.id);
}
