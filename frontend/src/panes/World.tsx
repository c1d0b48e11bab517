/** The world from above, as a domain's `scene` records describe it: metres, y upwards. */

import { memo, useMemo } from "react";
import type { SceneRec, Thing } from "../core/records";
import { session } from "../session";
import { useMoment } from "../turn";

const MARGIN = 0.12;
const NESTED = 0.075;
/** Metres; the labels of things that lie closer could not be read. */
const CLOSE = 0.18;

export function World() {
  const moment = useMoment();
  const scene = moment.scene === null ? undefined : session.history.record(moment.scene);
  const things = useMemo(() => (scene?.type === "scene" ? drawable((scene as SceneRec).things) : []), [scene]);
  const busy = new Set([...moment.working.values()].flatMap((one) => Object.values(one.arguments ?? {}).map(String)));
  const ever = session.history.marks.scene.length > 0;
  return (
    <section className="pane world" aria-label="World">
      <h2>World</h2>
      {things.length === 0 ? <p className={`quiet note ${ever ? "" : "none"}`}>{ever ? "Nothing has been seen yet." : "This run draws no world."}</p> : <Scene things={things} busy={busy} moving={driving(busy, things)} />}
    </section>
  );
}

/** Things that have a place; what else is not said of them is what is usual. */
function drawable(things: readonly Partial<Thing>[]): Thing[] {
  const said = (thing: object) => Object.fromEntries(Object.entries(thing).filter(([, value]) => value !== null && value !== undefined));
  return things.filter((thing) => typeof thing.x === "number" && typeof thing.y === "number")
    .map((thing) => ({ shape: "", label: thing.id, ...said(thing) }) as Thing);
}

/** Where the robot is on its way to. */
function driving(busy: ReadonlySet<string>, things: readonly Thing[]): Thing | null {
  const robot = things.find((thing) => thing.shape === "robot");
  const goal = things.find((thing) => busy.has(thing.id) && thing.width !== undefined);
  return robot && goal && Math.hypot(goal.x - robot.x, goal.y - robot.y) > (goal.depth ?? 0) / 2 + 0.6 ? goal : null;
}

const Scene = memo(function Scene({ things, busy, moving }: { things: readonly Thing[]; busy: ReadonlySet<string>; moving: Thing | null }) {
  const left = Math.min(...things.map((t) => Math.min(t.x, t.to_x ?? t.x) - (t.width ?? 0.3) / 2)) - MARGIN;
  const right = Math.max(...things.map(rightOf)) + MARGIN;
  const low = Math.min(...things.map((t) => Math.min(t.y, t.to_y ?? t.y) - (t.depth ?? 0.3) / 2)) - MARGIN - 0.3;
  const high = Math.max(...things.map((t) => Math.max(t.y, t.to_y ?? t.y) + (t.depth ?? 0.3) / 2)) + MARGIN + (things.some((t) => t.width === undefined) ? 0.35 : 0.1);
  const depths = nesting(things);
  const order = [...things].sort((a, b) => rank(a) - rank(b) || (depths.get(a.id) ?? 0) - (depths.get(b.id) ?? 0));
  const robot = things.find((thing) => thing.shape === "robot");
  const held = new Set(things.map((thing) => thing.in));
  const crowd = crowded(things);
  return (
    <svg viewBox={`${left} ${-high} ${right - left} ${high - low}`} role="group" aria-label={`The world from above: ${things.length} things`}>
      {robot && moving && <line className="way" x1={robot.x} y1={-robot.y} x2={moving.x} y2={-moving.y + (moving.depth ?? 0) / 2 + 0.2} />}
      {order.map((thing) => {
        const depth = depths.get(thing.id) ?? 0;
        const inHand = thing.in === "robot";
        const lift = depth * NESTED + (inHand ? 0.16 : 0);
        return (
          <g
            key={thing.id}
            className={`thing ${thing.shape} ${busy.has(thing.id) ? "busy" : ""}`}
            style={{ transform: `translate(${thing.x}px, ${-thing.y - lift}px)` }}
            tabIndex={0} role="button" aria-label={`${thing.label}${thing.in ? ` in ${thing.in}` : ""}`}
            onClick={() => session.select({ kind: "thing", id: thing.id })}
            onKeyDown={(event) => event.key === "Enter" && session.select({ kind: "thing", id: thing.id })}
          >
            <title>{`${thing.label}${thing.in ? ` in ${thing.in}` : ""}`}</title>
            <Shape thing={thing} />
            <Label
              thing={thing} quiet={(thing.in !== undefined && !inHand) || (crowd.has(thing.id) && !busy.has(thing.id))}
              stacked={held.has(thing.id)} count={countOn(thing, things, crowd)}
            />
          </g>
        );
      })}
    </svg>
  );
});

/** With room for its label: that of an item leans to the right, that of a place begins at its left. */
function rightOf(thing: Thing): number {
  if (thing.to_x !== undefined) return Math.max(thing.x, thing.to_x) + 0.15;
  if (thing.width === undefined) return thing.x + 0.25 + (thing.in === undefined ? thing.label.length * 0.05 : 0);
  return Math.max(thing.x + thing.width / 2, thing.x - thing.width / 2 + thing.label.length * 0.12);
}

/** Things that lie too close to others: how many there are is said where they lie. */
function crowded(things: readonly Thing[]): Set<string> {
  const loose = things.filter((thing) => rank(thing) === 2 && thing.in === undefined);
  const near = (one: Thing, other: Thing) => one !== other && Math.hypot(one.x - other.x, one.y - other.y) < CLOSE;
  return new Set(loose.filter((one) => loose.some((other) => near(one, other))).map((one) => one.id));
}

/** How many things lie on a place, if some of them are crowded. */
function countOn({ x, y, width = 0, depth = 0 }: Thing, things: readonly Thing[], crowd: ReadonlySet<string>): number {
  const here = things.filter((one) => rank(one) === 2 && Math.abs(one.x - x) <= width / 2 && Math.abs(one.y - y) <= depth / 2);
  return here.some((one) => crowd.has(one.id)) ? here.length : 0;
}

function rank(thing: Thing): number {
  return thing.width !== undefined ? 0 : thing.shape === "robot" ? 1 : 2;
}

/** How deep each thing is inside others; the hand does not count. */
function nesting(things: readonly Thing[]): Map<string, number> {
  const by = new Map(things.map((thing) => [thing.id, thing]));
  const depth = (thing: Thing | undefined, most: number): number =>
    thing?.in === undefined || by.get(thing.in)?.shape === "robot" || most === 0 ? 0 : 1 + depth(by.get(thing.in), most - 1);
  return new Map(things.map((thing) => [thing.id, depth(thing, 20)]));
}

function Shape({ thing }: { thing: Thing }) {
  const { shape, width = 0.4, depth = 0.4 } = thing;
  if (shape === "robot") {
    return (
      <>
        <circle className="body" r={0.2} />
        <path className="arm" d="M0 -0.05 L0 -0.26 M-0.07 -0.32 L0 -0.25 L0.07 -0.32" />
      </>
    );
  }
  if (shape === "operator") {
    return (
      <>
        <circle className="body" cy={-0.12} r={0.12} />
        <path className="body" d="M-0.25 0.25 a0.25 0.25 0 0 1 0.5 0 z" />
      </>
    );
  }
  if (thing.width !== undefined) {
    const box = { x: -width / 2, y: -depth / 2, width, height: depth, rx: 0.06 };
    return (
      <>
        <rect className="body" {...box} />
        {shape === "sink" && <ellipse className="hole" rx={width * 0.34} ry={depth * 0.34} />}
        {shape === "bin" && <rect className="hole" x={-width * 0.33} y={-depth * 0.33} width={width * 0.66} height={depth * 0.66} rx={0.05} />}
      </>
    );
  }
  if (thing.to_x !== undefined && thing.to_y !== undefined) {
    return (
      <>
        <line className="body" x1={0} y1={0} x2={thing.to_x - thing.x} y2={thing.y - thing.to_y} />
        <circle className="joint" r={0.025} />
      </>
    );
  }
  if (shape === "tool") return <circle className="body" r={0.04} />;
  if (shape.includes("crisp")) return <circle className="body" r={0.105} />;
  if (shape === "cup") {
    return (
      <>
        <path className="handle" d="M0.06 -0.03 a0.045 0.045 0 1 1 0 0.06" />
        <circle className="body" r={0.09} />
      </>
    );
  }
  return <circle className="body" r={0.075} />;
}

function Label({ thing, quiet, stacked, count }: { thing: Thing; quiet: boolean; stacked: boolean; count: number }) {
  if (quiet || thing.to_x !== undefined || thing.shape === "tool") return null; // joints are too close for labels
  const left = -(thing.width ?? 0) / 2;
  if (thing.shape === "operator") return <text className="place" x={left} y={-0.32}>{thing.label}</text>; // who comes stands below
  if (count > 0) return <text className="place" x={left} y={(thing.depth ?? 0) / 2 + 0.26}>{`${thing.label}: ${count}`}</text>;
  if (thing.width !== undefined) return <text className="place" x={left} y={(thing.depth ?? 0) / 2 + 0.26}>{thing.label}</text>;
  if (thing.shape === "robot") return <text className="place" x={0.26} y={0.26}>{thing.label}</text>;
  return <text className={`item ${stacked ? "stacked" : ""}`} transform="rotate(-62)" x={stacked ? 0.34 : 0.15} y={0.05}>{thing.label}</text>;
}
