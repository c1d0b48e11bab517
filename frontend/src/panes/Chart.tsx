/** The chart: what is active, what was taken lately; open, close, zoom in. */

import { MiniMap, ReactFlow, ReactFlowProvider } from "@xyflow/react";
import { useCallback, useEffect, useMemo, useState } from "react";
import { useCamera } from "../chart/camera";
import { drawnEdges, drawnNodes, type Acts } from "../chart/drawn";
import { knownLayout, layoutOf } from "../chart/elk";
import { signature, type Layout } from "../chart/layout";
import { StateNode } from "../chart/StateNode";
import { visible, type ChartNode, type View, type Visible } from "../chart/visible";
import { WayEdge } from "../chart/WayEdge";
import type { Moment } from "../core/moment";
import { joinPath } from "../core/plots";
import { session, useSelection, type Selection } from "../session";
import { turns, useMoment } from "../turn";
import { ChartTools } from "./ChartTools";

const NODES = { state: StateNode };
const EDGES = { way: WayEdge };
/** From so many states on, a small map says where one is. */
const MAPPED = 60;
const MAP = { width: 130, height: 96 };
const NOTHING: Layout = { boxes: new Map(), lines: new Map() };
const PLAIN: View = { focus: "", open: new Map(), all: new Set() };

export function Chart() {
  return (
    <ReactFlowProvider>
      <ChartPane />
    </ReactFlowProvider>
  );
}

function ChartPane() {
  const moment = useMoment();
  const selection = useSelection();
  const [view, setView] = useState(PLAIN);
  const [follow, setFollow] = useState(true);
  const focus = moment.bound.has(view.focus) ? view.focus : "";
  const shown = useMemo(() => visible(moment, session.history.plots, { ...view, focus }), [moment, view, focus]);
  const layout = useLayout(shown);
  const chosen = pathOf(selection, moment);
  const acts = useActs(setView);
  const nodes = useMemo(() => (layout ? drawnNodes(shown, layout, moment, chosen, acts) : []), [shown, layout, moment, chosen, acts]);
  const edges = useMemo(() => (layout ? drawnEdges(shown, layout, moment, chosen) : []), [shown, layout, moment, chosen]);
  useCamera(shown, layout, moment, follow);
  return (
    <section className="pane chart" aria-label="Chart">
      <h2>
        <Crumbs focus={focus} go={(path) => acts.zoom(path)} />
        <ChartTools
          nodes={nodes} edges={edges} focus={focus} follow={follow} setFollow={setFollow}
          reset={() => setView((before) => ({ ...PLAIN, focus: before.focus }))}
        />
      </h2>
      <div className="flow">
        <Tips />
        {shown.nodes.length === 0 && <p className="quiet note">Nothing runs yet: the first step is to come.</p>}
        <ReactFlow
          nodes={nodes} edges={edges} nodeTypes={NODES} edgeTypes={EDGES} minZoom={0.05} maxZoom={2.5}
          nodesDraggable={false} nodesConnectable={false} elementsSelectable={false} edgesFocusable={false} nodesFocusable={false}
          onlyRenderVisibleElements={nodes.length > 150} zoomOnDoubleClick={false} disableKeyboardA11y
          onMove={(event) => event && setFollow(false)} proOptions={{ hideAttribution: true }}
        >
          {nodes.length > MAPPED && (
            <MiniMap pannable zoomable style={MAP} ariaLabel="The whole chart" nodeClassName={mapped} />
          )}
        </ReactFlow>
      </div>
    </section>
  );
}

function mapped({ data }: { data: Record<string, unknown> }): string {
  const { expanded, active } = data.node as ChartNode;
  return expanded ? "open" : active ? "active" : "";
}

/** The state that is selected, or that carries out the step of a plan that is. */
function pathOf(selection: Selection | null, moment: Moment): string | null {
  if (selection?.kind === "state") return selection.path;
  const plan = selection?.kind === "step" ? moment.plans[selection.plan] : undefined;
  if (selection?.kind !== "step" || !plan || plan.at === null || plan.ended !== null) return null;
  const name = [...plan.names].find(([, step]) => step === selection.step)?.[0];
  return name === undefined ? null : joinPath(plan.at, name);
}

/** The layout of what is visible, or of what was until it is there. */
function useLayout(shown: Visible): Layout | null {
  const [done, setDone] = useState<{ key: string; layout: Layout; wrong?: string } | null>(null);
  const key = useMemo(() => signature(shown), [shown]);
  if (done?.wrong !== undefined && done.key === key) throw new Error(`the chart cannot be laid out: ${done.wrong}`);
  const known = done?.key === key ? done.layout : knownLayout(shown);
  useEffect(() => {
    if (known || shown.nodes.length === 0) return;
    let wanted = true;
    const forget = turns.whenCalm(() => void layoutOf(shown).then((layout) => wanted && layout && setDone({ key, layout }), (error: unknown) => wanted && setDone({ key, layout: NOTHING, wrong: String(error) })));
    return () => {
      wanted = false;
      forget();
    };
    // What is active changes `shown` often; only another picture needs another layout.
    // eslint-disable-next-line react-hooks/exhaustive-deps
  }, [key, known]);
  return known ?? done?.layout ?? null;
}

function useActs(setView: (change: (before: View) => View) => void): Acts {
  const select = useCallback((path: string) => session.select({ kind: "state", path }), []);
  return useMemo(() => ({
    select,
    toggle: (node) => setView((before) => ({ ...before, open: new Map(before.open).set(node.id, !node.expanded) })),
    zoom: (focus) => setView((before) => ({ ...before, focus })),
    showAll: (path) => setView((before) => ({ ...before, all: new Set(before.all).add(path) })),
  }), [select, setView]);
}

function Crumbs({ focus, go }: { focus: string; go: (path: string) => void }) {
  const parts = focus ? focus.split("/") : [];
  const { seq } = useMoment();
  const last = (path: readonly string[]) => session.history.words(path.join("/"), seq).split("/").at(-1);
  return (
    <nav aria-label="Where the chart is zoomed to">
      <button disabled={focus === ""} onClick={() => go("")}>Chart</button>
      {parts.map((_, i) => (
        <span key={i}>
          {" › "}
          <button disabled={i === parts.length - 1} onClick={() => go(parts.slice(0, i + 1).join("/"))}>{last(parts.slice(0, i + 1))}</button>
        </span>
      ))}
    </nav>
  );
}

/** Heads of arrows; a marker is found by its name from anywhere in the page. */
function Tips() {
  return (
    <svg className="tips" aria-hidden="true">
      <defs>
        {["tip", "tip-taken"].map((id) => (
          <marker key={id} id={id} viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto" markerUnits="userSpaceOnUse">
            <path className={id} d="M0 0.5 L8 4 L0 7.5 z" />
          </marker>
        ))}
      </defs>
    </svg>
  );
}
