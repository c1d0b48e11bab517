/** A transition: the line that the layout found, bright if it was taken lately. */

import type { Edge, EdgeProps } from "@xyflow/react";
import { memo } from "react";
import { labelOf, type Point } from "./layout";
import type { ChartEdge } from "./visible";

export interface WayData extends Record<string, unknown> {
  readonly edge: ChartEdge;
  readonly points: readonly Point[];
  readonly label: Point | null;
  /** 0 for the transition taken last, and so on; null if it was not taken lately. */
  readonly age: number | null;
}

export type WayEdgeType = Edge<WayData, "way">;

const ROUND = 6;

export const WayEdge = memo(function WayEdge({ id, data }: EdgeProps<WayEdgeType>) {
  if (!data) return null;
  const { edge, points, label, age } = data;
  const classes = ["way", edge.rule && "rule", edge.quiet && "faint", age !== null && "taken"].filter(Boolean).join(" ");
  const text = labelOf(edge);
  return (
    <g className={classes} data-way={id} style={age === null ? undefined : { ["--age" as string]: age }}>
      <path d={rounded(points)} markerEnd={`url(#${age === null ? "tip" : "tip-taken"})`} />
      {label && text && <text x={label.x} y={label.y}>{text}<title>{edge.labels.join(", ")}</title></text>}
    </g>
  );
});

/** A path with its corners rounded. */
export function rounded(points: readonly Point[]): string {
  const [first, ...rest] = points;
  if (!first) return "";
  const parts = [`M${first.x} ${first.y}`];
  rest.forEach((point, i) => {
    const before = points[i]!;
    const after = rest[i + 1];
    if (!after) return void parts.push(`L${point.x} ${point.y}`);
    const from = towards(point, before);
    const to = towards(point, after);
    parts.push(`L${from.x} ${from.y}`, `Q${point.x} ${point.y} ${to.x} ${to.y}`);
  });
  return parts.join(" ");
}

function towards(point: Point, other: Point): Point {
  const length = Math.hypot(other.x - point.x, other.y - point.y) || 1;
  const part = Math.min(ROUND, length / 2) / length;
  return { x: point.x + (other.x - point.x) * part, y: point.y + (other.y - point.y) * part };
}
