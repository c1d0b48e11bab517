/** A state of the chart: a box, with its insides if it is open. */

import { Handle, Position, type Node, type NodeProps } from "@xyflow/react";
import { memo } from "react";
import type { StepState } from "../core/plans";
import { shownName, title } from "./layout";
import type { ChartNode } from "./visible";

export interface StateData extends Record<string, unknown> {
  readonly node: ChartNode;
  readonly chosen: boolean;
  /** 0 for what was left last, up to the length of the trail; null if it was not left lately. */
  readonly left: number | null;
  /** How far the plan's step is that it carries out. */
  readonly progress: StepState | null;
  readonly select: (path: string) => void;
  readonly toggle: (node: ChartNode) => void;
  readonly zoom: (path: string) => void;
  readonly showAll: (path: string) => void;
}

export type StateNodeType = Node<StateData, "state">;

export const StateNode = memo(function StateNode({ data }: NodeProps<StateNodeType>) {
  const { node, chosen, left, progress } = data;
  const classes = ["state", node.kind, node.active && "active", node.expanded && "open", node.generated && "generated",
    chosen && "chosen", left !== null && !node.active && "left",
    progress && `step-${progress}`].filter(Boolean).join(" ");
  const said = `${node.name}, ${node.kind}${node.active ? ", active" : ""}${node.content ? `, ${node.content} inside` : ""}`;
  return (
    <div className={classes} style={left === null ? undefined : { ["--age" as string]: left }}>
      <Handle type="target" position={Position.Left} isConnectable={false} />
      {node.kind === "region" ? (
        <div className="bar"><span className="name">{node.name}</span></div>
      ) : (
        <div className="bar">
          <button className="name" aria-label={said} aria-pressed={chosen} title={node.about ?? shownName(node)} onClick={() => data.select(node.id)}>
            {node.kind === "gate" ? "" : (
              <>
                {node.initial && <span className="initial" aria-hidden="true">●</span>}
                {node.kind === "dynamic" && progress !== "done" && progress !== "failed" && <span className="mark" aria-hidden="true">◆</span>}
                {progress === "done" && <span className="mark done" aria-hidden="true">✓</span>}
                {progress === "failed" && <span className="mark failed" aria-hidden="true">✕</span>}
                {node.kind === "submachine" && <span className="mark" aria-hidden="true">▣</span>}
                <span>{shownName(node)}</span>
                {node.expanded && node.content && node.content !== node.name && <em>{node.content}</em>}
              </>
            )}
          </button>
          <span className="own">
          {node.expanded && node.hidden > 0 && (
            <button className="tool" title="Show the states that rules added" onClick={() => data.showAll(node.id)}>{`+${node.hidden}`}</button>
          )}
          {node.content && (
            <button className="tool" aria-label={`Zoom into ${node.name}`} title="Zoom into it" onClick={() => data.zoom(node.id)}>⤢</button>
          )}
          {node.expandable && (
            <button className="tool" aria-label={`${node.expanded ? "Collapse" : "Expand"} ${node.name}`} aria-expanded={node.expanded}
              title={node.expanded ? "Collapse" : "Expand"} onClick={() => data.toggle(node)}>
              {node.expanded ? "−" : "+"}
            </button>
          )}
          </span>
        </div>
      )}
      {!node.expanded && title(node) && node.kind !== "gate" && <div className="under">{title(node)}</div>}
      {node.ways > 0 && <span className="ways" title="ways that lead here and are not drawn">{`←${node.ways}`}</span>}
      <Handle type="source" position={Position.Right} isConnectable={false} />
    </div>
  );
}, (before, after) => {
  // Each moment makes its nodes anew; most of them say the same as before.
  const { node: one, ...rest } = before.data;
  const { node: other, ...others } = after.data;
  return shallowly(one, other) && shallowly(rest, others);
});

function shallowly(one: object, other: object): boolean {
  const values = other as Readonly<Record<string, unknown>>;
  return Object.entries(one).every(([name, value]) => Object.is(value, values[name]));
}
