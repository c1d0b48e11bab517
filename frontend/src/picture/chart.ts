/** The chart of a moment as a drawing: all that is open in the pane, whole. */

import { labelOf, shownName, title } from "../chart/layout";
import type { StateNodeType } from "../chart/StateNode";
import { rounded, type WayEdgeType } from "../chart/WayEdge";
import { escaped, INK, text, type Part } from "./sheet";

export function chartPart(nodes: readonly StateNodeType[], edges: readonly WayEdgeType[]): Part {
  const width = Math.max(0, ...nodes.map((node) => node.position.x + (node.width ?? 0)));
  const height = Math.max(0, ...nodes.map((node) => node.position.y + (node.height ?? 0)));
  // As in the pane: what is inside lies on what holds it, and a way on the insides of what holds it.
  const parts = [...nodes.map((node) => ({ z: node.zIndex ?? 0, text: state(node) })), ...edges.map((edge) => ({ z: edge.zIndex ?? 0, text: way(edge) }))];
  return { width, height, body: parts.sort((a, b) => a.z - b.z).map((part) => part.text).join("\n") };
}

function state({ data, position: { x, y }, width = 0, height = 0 }: StateNodeType): string {
  const { node, progress } = data;
  const stroke = node.generated ? INK.purple : node.active ? INK.blue : progress === "failed" ? INK.red : progress === "done" ? INK.green : INK.line;
  const fill = node.expanded ? (node.generated ? "url(#plan)" : node.active ? "#f3f9fd" : "#fff") : node.active ? INK.soft : "#fff";
  const dash = node.generated || node.kind === "region" ? ' stroke-dasharray="5 3"' : "";
  const round = node.kind === "final" || node.kind === "pseudo" || node.kind === "gate" ? height / 2 : 8;
  const box = `<rect x="${x}" y="${y}" width="${width}" height="${height}" rx="${round}" fill="${fill}" stroke="${stroke}" stroke-width="${node.active ? 2 : 1.2}"${dash}/>`;
  const inner = node.kind === "final" ? `<rect x="${x + 2.5}" y="${y + 2.5}" width="${width - 5}" height="${height - 5}" rx="${round - 2.5}" fill="none" stroke="${stroke}"/>` : "";
  if (node.kind === "gate") return box;
  const under = node.expanded ? "" : title(node);
  const line = node.expanded ? 19 : under ? height / 2 - 3 : height / 2 + 4.5;
  const mark = `${node.initial ? "● " : ""}${progress === "done" ? "✓ " : progress === "failed" ? "✕ " : node.kind === "dynamic" ? "◆ " : node.kind === "submachine" ? "▣ " : ""}`;
  const name = `${mark}${shownName(node)}${node.expanded && node.content && node.content !== node.name ? `  ${node.content}` : ""}`;
  const texts = [text(name, x + 9, y + line, width - 14, node.active ? "bold" : ""), under && text(under, x + 9, y + line + 15, width - 14, "small")];
  return box + inner + texts.join("");
}

function way({ data }: WayEdgeType): string {
  if (!data) return "";
  const { edge, points, label, age } = data;
  const taken = age !== null;
  const look = `stroke="${taken ? INK.blue : INK.line}" stroke-width="${taken ? 3 - age * 0.2 : 1.1}" opacity="${taken ? 1 - age * 0.08 : 1}"`;
  const dash = edge.rule ? ' stroke-dasharray="2 3"' : "";
  const said = labelOf(edge);
  return `<path d="${rounded(points)}" fill="none" ${look}${dash} marker-end="url(#${taken ? "taken" : "tip"})"/>`
    + (label && said ? `<text class="label" x="${label.x}" y="${label.y + 4}">${escaped(said)}</text>` : "");
}
