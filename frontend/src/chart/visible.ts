/** Which states and transitions of a moment's chart are to be seen: what is collapsed has no insides. */

import type { Moment, Plots } from "../core/moment";
import { joinPath, splitPath, statesOf, waysOf, type Kind, type PlotForm, type PlotState, type Way } from "../core/plots";
import { eventWords, stateWords } from "../core/words";


/** So many ways into one state would be a thicket: they are drawn only when asked for. */
export const HUB = 6;

/** Where every step of a plan leads to if it fails. */
const WAY_OUT = /^(replan|gave_up)(_\d+)*$/;

/** Where a rule tries a step of a plan again, or skips it. */
const FOR_RULES = /^step_\d+_(again|skipped)$/;

/** With more states than that in a plot, what is not active is closed until it is opened: the rest can be read then. */
export const MANY = 60;

export interface ChartNode {
  readonly id: string;
  readonly parent: string | null;
  readonly kind: Kind | "gate";
  /** In words, as its author wrote it. */
  readonly name: string;
  readonly about: string | undefined;
  /** Name of the plot inside, if one is bound. */
  readonly content: string | null;
  readonly generated: boolean;
  readonly initial: boolean;
  readonly expandable: boolean;
  readonly expanded: boolean;
  readonly active: boolean;
  /** How many states of this node's content are left out: what rules added and nothing uses now. */
  readonly hidden: number;
  /** How many ways lead here that are not drawn. */
  readonly ways: number;
}

export interface ChartEdge {
  readonly id: string;
  readonly from: string;
  readonly to: string;
  readonly labels: readonly string[];
  readonly rule: boolean;
  /** Not laid out, and drawn only when asked for. */
  readonly quiet: boolean;
  /** The transitions that end on it, as `edgeOf` names them. */
  readonly via: readonly string[];
}

export interface Visible {
  readonly nodes: readonly ChartNode[];
  readonly edges: readonly ChartEdge[];
}

export interface View {
  /** Path of the state whose content fills the pane; "" is the outermost plot. */
  readonly focus: string;
  /** Paths that were opened or closed by hand. */
  readonly open: ReadonlyMap<string, boolean>;
  /** Paths of holders all of whose states are shown. */
  readonly all: ReadonlySet<string>;
}

export function visible(moment: Moment, plots: Plots, view: View): Visible {
  const nodes: ChartNode[] = [];
  const edges: ChartEdge[] = [];
  const focused = plots.get(moment.bound.get(view.focus) ?? "");
  if (focused) show({ moment, plots, view, nodes, edges }, view.focus, focused, null, 0);
  return { nodes, edges };
}

interface Showing {
  readonly moment: Moment;
  readonly plots: Plots;
  readonly view: View;
  readonly nodes: ChartNode[];
  readonly edges: ChartEdge[];
}

/** Show the states of the plot that runs in `holder`; returns how many it left out. */
function show(on: Showing, holder: string, plot: PlotForm, around: string | null, depth: number): number {
  const states = statesOf(plot);
  const shown = new Map<string, string | null>(); // name -> parent's id
  let hidden = 0;
  const own: PlotState[] = [];
  const closed = new Set<string>();
  const large = states.length > MANY;
  const gates = new Set<string>();
  for (const state of states) {
    const id = joinPath(holder, state.name);
    if (state.parent !== null && (closed.has(state.parent) || !shown.has(state.parent))) continue;
    if (plot.generated && isGate(state) && !on.moment.active.has(id)) {
      gates.add(state.name);
      continue;
    }
    if (plot.generated && isSpare(on, holder, id, state)) {
      hidden += 1;
      continue;
    }
    shown.set(state.name, state.parent === null ? around : joinPath(holder, state.parent));
    own.push(state);
    if ((state.kind === "composite" || state.kind === "orthogonal") && !(on.view.open.get(id) ?? (!large || on.moment.active.has(id)))) closed.add(state.name);
  }
  const edges = edgesBetween(holder, states, throughGates(waysOf(plot), gates), shown, plot);
  const counts = new Map<string, number>();
  for (const edge of edges) if (edge.quiet) counts.set(edge.to, (counts.get(edge.to) ?? 0) + 1);
  for (const state of own) {
    const id = joinPath(holder, state.name);
    showState(on, plot, state, id, shown.get(state.name)!, counts.get(id) ?? 0, depth, large);
  }
  on.edges.push(...edges);
  return hidden;
}

function showState(
  on: Showing, plot: PlotForm, state: PlotState, id: string, parent: string | null, ways: number, depth: number,
  large: boolean,
): void {
  const { moment, plots, view, nodes } = on;
  const inner = plots.get(moment.bound.get(id) ?? "");
  const active = state.kind === "region" ? false : moment.active.has(id);
  const holds = state.kind === "submachine" || state.kind === "dynamic";
  const byItself = active && (depth === 0 || (inner?.generated ?? false));
  const expandable = holds ? inner !== undefined : state.kind === "composite" || state.kind === "orthogonal";
  const expanded = expandable ? view.open.get(id) ?? (holds ? byItself : !large || active) : state.kind === "region";
  const place = nodes.length;
  const gate = plot.generated === true && isGate(state);
  const node: ChartNode = {
    id, parent, kind: gate ? "gate" : state.kind, name: stateWords(plot, state.name), about: state.form.about,
    content: inner?.plot ?? null, generated: inner?.generated === true, initial: state.initial, expandable, expanded, active,
    hidden: 0, ways,
  };
  nodes.push(node);
  if (!holds || !expanded || inner === undefined) return;
  const hidden = show(on, id, inner, id, depth + 1);
  nodes[place] = { ...node, hidden };
}

/** Between two steps of a plan: where it is looked whether the next one may begin. */
function isGate(state: PlotState): boolean {
  return state.kind === "simple" && /^(before|after)(_\d+)*$/.test(state.name);
}

interface Through extends Way {
  readonly via: readonly string[];
}

/** Ways that lead through gates nobody waits at, as one. */
function throughGates(ways: readonly Way[], gates: ReadonlySet<string>): Through[] {
  const id = (way: Way) => `${way.from}>${way.to}`;
  return ways.flatMap((way): Through[] => {
    if (gates.has(way.from)) return [];
    if (!gates.has(way.to)) return [{ ...way, via: [id(way)] }];
    const onward = ways.filter((next) => next.from === way.to);
    return onward.map((next) => ({ ...way, to: next.to, via: [id(next)] }));
  });
}

/** States that rules need and that nothing uses now: a generated plot has many. */
function isSpare(on: Showing, holder: string, id: string, state: PlotState): boolean {
  return (state.form.about?.startsWith("rule: ") === true || FOR_RULES.test(state.name)) && !on.moment.active.has(id) && !on.view.all.has(holder);
}

/** Ways between what is shown: those between the same two are one, those across a border are lifted to it. */
function edgesBetween(
  holder: string, states: readonly PlotState[], ways: readonly Through[], shown: ReadonlyMap<string, string | null>,
  plot: PlotForm,
): ChartEdge[] {
  const parents = new Map(states.map((state) => [state.name, state.parent]));
  const merged = new Map<string, { from: string; to: string; labels: Set<string>; rule: boolean; via: string[] }>();
  for (const way of ways) {
    const ends = lifted(way.from, way.to, parents);
    if (ends === null || !shown.has(ends[0]) || !shown.has(ends[1])) continue;
    const key = `${ends[0]}>${ends[1]}`;
    const edge = merged.get(key) ?? { from: ends[0], to: ends[1], labels: new Set(), rule: true, via: [] };
    edge.labels.add(eventWords(plot, way.on));
    edge.via.push(...way.via);
    edge.rule &&= way.rule !== undefined;
    merged.set(key, edge);
  }
  const into = new Map<string, number>();
  for (const edge of merged.values()) into.set(edge.to, (into.get(edge.to) ?? 0) + 1);
  return [...merged].map(([key, edge]) => ({
    id: joinPath(holder, key),
    from: joinPath(holder, edge.from),
    to: joinPath(holder, edge.to),
    labels: [...edge.labels],
    rule: edge.rule,
    quiet: into.get(edge.to)! > HUB || (plot.generated === true && WAY_OUT.test(edge.to)),
    via: edge.via.map((one) => joinPath(holder, one)),
  }));
}

/** The two states next to each other that a transition leads between; null if one is inside the other. */
function lifted(from: string, to: string, parents: ReadonlyMap<string, string | null>): [string, string] | null {
  const above = (name: string) => {
    const found = [name];
    for (let at = parents.get(name); at; at = parents.get(at)) found.push(at);
    return found.reverse();
  };
  const [one, other] = [above(from), above(to)];
  const level = one.findIndex((name, i) => name !== other[i]);
  if (from === to) return [from, to];
  const [a, b] = [one[level], other[level]];
  return level < 0 || a === undefined || b === undefined ? null : [a, b];
}

/** The edge that shows a transition taken between two paths, by its id. */
export function edgeOf(from: string, to: string): string {
  const [holder, name] = splitPath(from);
  return joinPath(holder, `${name}>${splitPath(to)[1]}`);
}
