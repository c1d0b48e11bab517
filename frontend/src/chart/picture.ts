/** The chart of a moment as a drawing of its own: all that is open in the pane, whole, on white. */

import { rounded } from "./WayEdge";
import { labelOf, shownName, title } from "./layout";
import type { StateNodeType } from "./StateNode";
import type { WayEdgeType } from "./WayEdge";

const MARGIN = 16;
const CAPTION = 26;
const INK = { ink: "#1b2027", quiet: "#5b6470", line: "#9aa2af", blue: "#0072b2", soft: "#dcecf7", green: "#007a5a", red: "#b84a00", purple: "#a5497a" };
const STYLE = `text{font:13px system-ui,"DejaVu Sans",sans-serif;fill:${INK.ink}} .small{font-size:11px;fill:${INK.quiet}}
.label{font-size:10.5px;fill:${INK.quiet};text-anchor:middle;paint-order:stroke;stroke:#fff;stroke-width:3px} .bold{font-weight:650}`;

export function pictureOf(nodes: readonly StateNodeType[], edges: readonly WayEdgeType[], caption: string): string {
  const right = Math.max(0, ...nodes.map((node) => node.position.x + (node.width ?? 0)));
  const low = Math.max(0, ...nodes.map((node) => node.position.y + (node.height ?? 0)));
  const [width, height] = [Math.ceil(right) + 2 * MARGIN, Math.ceil(low) + 2 * MARGIN + CAPTION];
  // As in the pane: what is inside lies on what holds it, and a way on the insides of what holds it.
  const parts = [...nodes.map((node) => ({ z: node.zIndex ?? 0, text: state(node) })), ...edges.map((edge) => ({ z: edge.zIndex ?? 0, text: way(edge) }))];
  const drawn = parts.sort((a, b) => a.z - b.z).map((part) => part.text).join("\n");
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" height="${height}">
<title>${escaped(caption)}</title><style>${STYLE}</style><defs>${tip("tip", INK.line)}${tip("taken", INK.blue)}
<pattern id="plan" width="9" height="9" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="9" height="9" fill="#fff"/><path d="M0 0v9" stroke="#faeef4" stroke-width="2"/></pattern></defs>
<rect width="100%" height="100%" fill="#fff"/><text class="small" x="${MARGIN}" y="20">${escaped(caption)}</text>
<g transform="translate(${MARGIN} ${MARGIN + CAPTION})">
${drawn}
</g></svg>
`;
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
  const name = `${mark}${shownName(node)}${node.expanded && node.content ? `  ${node.content}` : ""}`;
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

/** Squeezed where it would not fit: another machine may have wider letters. */
function text(said: string, x: number, y: number, most: number, style: string): string {
  const wide = said.length * (style === "small" ? 6.2 : 7.4) > most ? ` textLength="${most}" lengthAdjust="spacingAndGlyphs"` : "";
  return `<text class="${style}" x="${x}" y="${y}"${wide}>${escaped(said)}</text>`;
}

function tip(id: string, fill: string): string {
  return `<marker id="${id}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto" markerUnits="userSpaceOnUse"><path d="M0 0.5 8 4 0 7.5z" fill="${fill}"/></marker>`;
}

function escaped(said: string): string {
  return said.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");
}
