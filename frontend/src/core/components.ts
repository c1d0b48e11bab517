/** Components: their wires, modes and waits at a moment, and the values that a monitoring profile observes over time. */

import type { ActionRec, ComponentRec, ObservationRec } from "./records";
import type { Value } from "./values";
import { placeAfter } from "./search";

/** What is known of a component after a record. */
export interface ComponentState {
  readonly mode: string | null;
  /** Its provided ports by required ones; null where no service is wired. */
  readonly wires: Readonly<Record<string, string | null>>;
  /** Why it waits for resources. */
  readonly waits: string | null;
}

export type Components = Map<string, ComponentState>;

const UNKNOWN: ComponentState = { mode: null, wires: {}, waits: null };

export function withComponent(components: Components, { component, wires, waits }: ComponentRec): void {
  const before = components.get(component) ?? UNKNOWN;
  components.set(component, { ...before, ...(wires && { wires }), ...(waits !== undefined && { waits }) });
}

/** A component appears with its first action. */
export function withAction(components: Components, { action, component, mode, skill, port }: ActionRec): void {
  const name = component ?? (skill ?? port)?.split(".")[0];
  if (name === undefined) return;
  const before = components.get(name) ?? UNKNOWN;
  components.set(name, action === "switch" && mode !== undefined ? { ...before, mode } : before);
}

export interface Point {
  readonly seq: number;
  readonly t: number;
  readonly value: Value;
}

/** Values over time by entry, for each component; records have several values, each an entry of the next level. */
export class Observed {
  private readonly series = new Map<string, Map<string, Point[]>>();

  add(rec: ObservationRec): void {
    const entries = this.series.get(rec.component) ?? new Map<string, Point[]>();
    this.series.set(rec.component, entries);
    for (const [entry, value] of partsOf(rec.entry, rec.value)) {
      const points = entries.get(entry) ?? [];
      entries.set(entry, points);
      points.push({ seq: rec.seq, t: rec.t, value });
    }
  }

  get names(): Iterable<string> {
    return this.series.keys();
  }

  /** The values of a component up to a record, without entries that have none yet. */
  of(component: string, seq: number): [string, readonly Point[]][] {
    return [...(this.series.get(component) ?? [])]
      .map(([entry, points]): [string, Point[]] => [entry, points.slice(0, placeAfter(points, seq, (one) => one.seq))])
      .filter(([, points]) => points.length > 0);
  }
}

function partsOf(entry: string, value: Value): [string, Value][] {
  if (value === null || typeof value !== "object" || Array.isArray(value)) return [[entry, value]];
  return Object.entries(value).map(([name, one]) => [`${entry}.${name}`, one]);
}

export interface Size {
  readonly width: number;
  readonly height: number;
}

/** Numbers over time as the path of a line with steps, from the first second to `end`; null for other values. */
export function lineOf(points: readonly Point[], end: number, { width, height }: Size): string | null {
  const numbers = points.filter((one) => typeof one.value === "number" && Number.isFinite(one.value));
  if (numbers.length === 0 || numbers.length < points.length) return null;
  const values = numbers.map((one) => one.value as number);
  const [low, high] = [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
  const x = (t: number) => ((t / (end || 1)) * width).toFixed(1);
  const y = (value: number) => (high === low ? height / 2 : height - ((value - low) / (high - low)) * height).toFixed(1);
  const [first, ...others] = thinned(numbers, width);
  const steps = others.map((one) => `H${x(one.t)}V${y(one.value as number)}`).join("");
  return `M${x(first!.t)} ${y(first!.value as number)}${steps}H${x(end)}`;
}

/** At most one value for each pixel: the last one. */
function thinned(points: readonly Point[], most: number): readonly Point[] {
  if (points.length <= most) return points;
  const every = points.length / most;
  return Array.from({ length: most }, (_, i) => points[Math.ceil((i + 1) * every) - 1]!);
}
