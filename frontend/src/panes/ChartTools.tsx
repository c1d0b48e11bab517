/** What can be done with the whole chart: follow, zoom, put back, save as a drawing. */

import { useReactFlow } from "@xyflow/react";
import type { StateNodeType } from "../chart/StateNode";
import type { WayEdgeType } from "../chart/WayEdge";
import { chartPart } from "../picture/chart";
import { planPart } from "../picture/plan";
import { below, beside, sheet, type Part } from "../picture/sheet";
import { worldPart } from "../picture/world";
import { session } from "../session";
import { useMoment } from "../turn";
import { seconds } from "./Timeline";

interface Props {
  readonly nodes: readonly StateNodeType[];
  readonly edges: readonly WayEdgeType[];
  /** Path of the state that is zoomed into. */
  readonly focus: string;
  readonly follow: boolean;
  readonly setFollow: (follow: boolean) => void;
  readonly reset: () => void;
}

export function ChartTools({ nodes, edges, focus, follow, setFollow, reset }: Props) {
  const flow = useReactFlow();
  const moment = useMoment();
  const look = (act: () => Promise<boolean>) => () => {
    setFollow(false);
    void act();
  };
  const save = (name: string, part: Part) => {
    const run = String(session.get().header.run ?? "a run");
    download(`${name}-${moment.seq}.svg`, sheet(part, `${run}${focus && `, ${session.history.words(focus, moment.seq)}`}: ${seconds(moment.t)}, after record ${moment.seq}`));
  };
  const saveAll = () => {
    const world = worldPart(document.querySelector<SVGSVGElement>(".world svg"));
    save("moment", beside(below(world, planPart(moment.plans)), chartPart(nodes, edges)));
  };
  return (
    <span className="tools">
      <label title="Keep what is active in sight"><input type="checkbox" checked={follow} onChange={(event) => setFollow(event.target.checked)} /> follow</label>
      <span className="group" role="group" aria-label="Zoom">
        <button aria-label="Zoom out" title="Zoom out" onClick={look(() => flow.zoomOut())}>−</button>
        <button aria-label="Zoom in" title="Zoom in" onClick={look(() => flow.zoomIn())}>+</button>
        <button title="The whole chart" onClick={look(() => flow.fitView())}>fit</button>
      </span>
      <button title="Open and close states as at first" onClick={reset}>reset</button>
      <span className="group" role="group" aria-label="Save as a drawing">
        <button onClick={() => save("chart", chartPart(nodes, edges))} title="Save this chart at this moment as a drawing">SVG</button>
        <button onClick={saveAll} title="Save world, plan and chart of this moment as one drawing">SVG of all</button>
      </span>
    </span>
  );
}

function download(name: string, picture: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([picture], { type: "image/svg+xml" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
