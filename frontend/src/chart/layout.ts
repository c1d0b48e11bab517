/** Where everything goes: each composite laid out by itself, in layers, by the Eclipse Layout Kernel. */

import type { ELK, ElkExtendedEdge, ElkNode } from "elkjs/lib/elk-api";
import type { ChartEdge, ChartNode, Visible } from "./visible";

export interface Box {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

export interface Point {
  readonly x: number;
  readonly y: number;
}

export interface Layout {
  readonly boxes: ReadonlyMap<string, Box>;
  readonly lines: ReadonlyMap<string, { readonly points: readonly Point[]; readonly label: Point | null }>;
}

const LAYERED = {
  "elk.algorithm": "layered",
  "elk.direction": "DOWN",
  "elk.layered.cycleBreaking.strategy": "MODEL_ORDER",
  "elk.edgeRouting": "ORTHOGONAL",
  "elk.layered.spacing.nodeNodeBetweenLayers": "34",
  "elk.spacing.nodeNode": "20",
  "elk.spacing.edgeNode": "12",
  "elk.spacing.edgeEdge": "9",
  "elk.spacing.edgeLabel": "3",
  "elk.layered.considerModelOrder.strategy": "NODES_AND_EDGES",
  "elk.layered.nodePlacement.strategy": "NETWORK_SIMPLEX",
  "elk.aspectRatio": "1.5",
};

/** Long chains are broken into lines, as text is. */
const WRAPPED = {
  "elk.layered.wrapping.strategy": "MULTI_EDGE",
  "elk.layered.wrapping.additionalEdgeSpacing": "8",
  "elk.aspectRatio": "1.5",
};

/** Designed charts branch and return, and are broken only if they would not fit at all. */
const LONG = 16;

/** The steps of a plan are read as a text is. */
const STEPS = { ...WRAPPED, "elk.direction": "RIGHT" };

/** What everything leads to stands at the end. */
const LAST = { "elk.layered.layering.layerConstraint": "LAST" };

const HEADER = 30;

/** The same for two charts that differ only in what is active. */
export function signature({ nodes, edges }: Visible): string {
  const drawn = nodes.map((n) => `${n.id}|${n.kind}|${n.expanded ? 1 : 0}|${n.content ?? ""}|${n.hidden}`);
  return [...drawn, ...edges.filter((e) => !e.quiet).map((e) => e.id)].join("\n");
}

export async function layout(elk: ELK, { nodes, edges }: Visible): Promise<Layout> {
  const graph = asGraph(nodes, edges);
  return read(await elk.layout(graph));
}

export function sizeOf(node: ChartNode): { width: number; height: number } {
  if (node.kind === "gate") return { width: 14, height: 14 };
  if (node.kind === "pseudo") return { width: 28, height: 28 };
  const widest = Math.max(shownName(node).length * 7.4 + (node.initial ? 62 : 48), title(node).length * 6.2 + 20, 74);
  if (node.kind === "final") return { width: Math.min(widest, 150), height: 30 };
  return { width: Math.min(widest, 190), height: title(node) ? 46 : 34 };
}

/** The name as it is written: a plan's step by its action. */
export function shownName(node: ChartNode): string {
  const action = stepOf(node)?.[0];
  return action === undefined ? node.name : `${node.name.match(/^\d+|\d+$/)?.[0] ?? ""} ${action}`.trim();
}

/** What stands under a state's name: the arguments of a plan's step, or the plot inside. */
export function title(node: ChartNode): string {
  return stepOf(node)?.slice(1).join(" ") ?? node.content ?? "";
}

/** Action and arguments of the plan's step that a state carries out. */
function stepOf(node: ChartNode): string[] | undefined {
  return node.about?.startsWith("(") ? node.about.slice(1, -1).split(" ") : undefined;
}

function asGraph(nodes: readonly ChartNode[], edges: readonly ChartEdge[]): ElkNode {
  const made = new Map<string | null, ElkNode>([[null, { id: "\u0000root", layoutOptions: { ...LAYERED }, children: [], edges: [] }]]);
  for (const node of nodes) {
    const inner = node.expanded && (node.expandable || node.kind === "region");
    const padding = { "elk.padding": `[top=${HEADER + 12},left=14,bottom=14,right=14]` };
    const box: ElkNode = inner
      ? { id: node.id, layoutOptions: { ...LAYERED, ...padding }, children: [], edges: [] }
      : { id: node.id, ...sizeOf(node), ...(node.ways > 0 && { layoutOptions: LAST }) };
    if (inner) box.layoutOptions!["elk.nodeSize.constraints"] = "MINIMUM_SIZE";
    if (inner) box.layoutOptions!["elk.nodeSize.minimum"] = `(${node.name.length * 8 + 130}, 60)`;
    made.set(node.id, box);
    made.get(node.parent)?.children?.push(box);
  }
  const parents = new Map(nodes.map((node) => [node.id, node.parent]));
  for (const edge of edges) {
    if (edge.quiet || parents.get(edge.from) !== parents.get(edge.to)) continue;
    const text = labelOf(edge);
    const drawn: ElkExtendedEdge = { id: edge.id, sources: [edge.from], targets: [edge.to] };
    if (text) drawn.labels = [{ text, width: text.length * 5.8 + 6, height: 13 }];
    made.get(parents.get(edge.from) ?? null)?.edges?.push(drawn);
  }
  for (const box of made.values()) if ((box.children?.length ?? 0) >= LONG) Object.assign(box.layoutOptions!, WRAPPED);
  for (const node of nodes) {
    if (stepOf(node)) Object.assign(made.get(node.parent)!.layoutOptions!, STEPS);
    if (node.kind === "orthogonal" && node.expanded) stack(made.get(node.id)!);
  }
  return made.get(null)!;
}

/** Regions stand below each other in their order, as if one led to the next. */
function stack(box: ElkNode): void {
  const regions = box.children ?? [];
  box.edges = regions.slice(1).map((region, i) => ({ id: `\u0000${region.id}`, sources: [regions[i]!.id], targets: [region.id] }));
}

export function labelOf(edge: ChartEdge): string {
  const said = edge.labels.filter((label) => label !== "always" && (label !== "done" || edge.via.includes(edge.id)));
  const first = said.slice(0, 2).join(", ");
  return said.length > 2 ? `${first} +${said.length - 2}` : first;
}

function read(root: ElkNode): Layout {
  const boxes = new Map<string, Box>();
  const lines = new Map<string, { points: Point[]; label: Point | null }>();
  const walk = (node: ElkNode, x: number, y: number) => {
    for (const edge of node.edges ?? []) {
      const points = (edge.sections ?? []).flatMap((s) => [s.startPoint, ...(s.bendPoints ?? []), s.endPoint]);
      const label = edge.labels?.[0];
      const middle = label && { x: x + (label.x ?? 0) + (label.width ?? 0) / 2, y: y + (label.y ?? 0) + (label.height ?? 0) / 2 };
      lines.set(edge.id, { points: points.map((p) => ({ x: p.x + x, y: p.y + y })), label: middle ?? null });
    }
    for (const child of node.children ?? []) {
      const at = { x: x + (child.x ?? 0), y: y + (child.y ?? 0) };
      boxes.set(child.id, { ...at, width: child.width ?? 0, height: child.height ?? 0 });
      walk(child, at.x, at.y);
    }
  };
  walk(root, 0, 0);
  return { boxes, lines };
}
