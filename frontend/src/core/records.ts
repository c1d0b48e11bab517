/** The records of a trace, as `dsc/viewer/PROTOCOL.md` names them. */

import type { PlotForm } from "./plots";
import type { Fact, Named, Value, Words } from "./values";

export interface Rec {
  readonly seq: number;
  readonly t: number;
  readonly type: string;
  readonly cause: number | null;
}

export interface PlotRec extends Rec {
  readonly hash: string;
  readonly plot: PlotForm;
  readonly words?: Words;
}

export interface Taken {
  readonly from: string;
  readonly on: string;
  readonly to: string | null;
}

export interface Micro {
  readonly event: string | null;
  readonly taken: readonly Taken[];
  readonly exited: readonly string[];
  readonly entered: readonly string[];
  readonly bound?: readonly { readonly state: string; readonly plot: string; readonly hash: string }[];
}

export interface StepRec extends Rec {
  readonly microsteps: readonly Micro[];
  readonly variables?: Readonly<Record<string, Named>>;
}

export interface Explanation {
  readonly text?: string;
  readonly truth?: boolean | null;
  readonly detail?: string | null;
  /** The number of the child that decides, from 0. */
  readonly decider?: number;
  readonly children?: readonly Explanation[];
}

export interface Candidate {
  readonly plot: string;
  readonly fits: boolean;
  readonly reason: string;
  readonly condition: Explanation;
  readonly score?: number;
  /** The tries from which a learned score follows. */
  readonly learned?: string;
}

export interface DecisionRec extends Rec {
  readonly state: string;
  readonly chosen: string | null;
  readonly satisfied: boolean;
  /** What it chose by among those that fit, if not by their order. */
  readonly by?: string;
  readonly situation?: Readonly<Record<string, boolean>>;
  /** Whether the candidate was chosen at random. */
  readonly explored?: boolean;
  readonly arguments?: Named;
  readonly version?: number;
  readonly candidates?: readonly Candidate[];
}

export interface KnowledgeRec extends Rec {
  readonly version: number;
  readonly author: string;
  readonly nodes?: Readonly<Record<string, string>>;
  readonly removed_nodes?: readonly string[];
  readonly added?: readonly Fact[];
  readonly removed?: readonly Fact[];
  readonly values?: readonly (readonly Value[])[];
}

export interface WorldRec extends Rec {
  readonly version: number;
  readonly nodes: Readonly<Record<string, string>>;
  readonly facts: readonly Fact[];
  readonly values: readonly (readonly Value[])[];
}

export interface Thing {
  readonly id: string;
  readonly shape: string;
  readonly x: number;
  readonly y: number;
  readonly label: string;
  readonly width?: number;
  readonly depth?: number;
  readonly in?: string;
  readonly to_x?: number;
  readonly to_y?: number;
}

export interface SceneRec extends Rec {
  readonly things: readonly Thing[];
}

export interface PlanAskedRec extends Rec {
  readonly goal: string;
}

export interface PlanNoneRec extends Rec {
  readonly kind: string;
  readonly reason: string;
}

export interface PlanFoundRec extends Rec {
  readonly plot: string;
  readonly steps: readonly string[];
  readonly engine?: string;
}

export interface PlanOrderedRec extends Rec {
  readonly plot: string;
  readonly steps: readonly string[];
  /** Who brings about what for whom: step number (0: it holds already), fact, step number (one past the last: goal). */
  readonly links?: readonly (readonly [number, string, number])[];
}

export interface PlanBrokenRec extends Rec {
  readonly reason: string;
  readonly author: string;
  readonly step: number;
  readonly version?: number;
  readonly link?: { readonly fact: string; readonly step: number; readonly user: string };
}

export interface ActionRec extends Rec {
  readonly action: string;
  readonly id?: string;
  readonly skill?: string;
  readonly port?: string;
  readonly value?: Value;
  readonly component?: string;
  readonly mode?: string;
  /** Of `wire`: the provided port; null cuts the wire. */
  readonly to?: string | null;
  /** Of `wait`: the skill whose end it waits for. */
  readonly for?: string;
  readonly arguments?: Named;
}

/** Of a component with required ports, or one that waits for resources. */
export interface ComponentRec extends Rec {
  readonly component: string;
  readonly wires?: Readonly<Record<string, string | null>>;
  readonly waits?: string | null;
}

export interface ObservationRec extends Rec {
  readonly component: string;
  readonly entry: string;
  readonly value: Value;
}

/** A change of the plots of a run. */
export interface PlotsRec extends Rec {
  readonly installed?: readonly string[];
  readonly components?: readonly string[];
  readonly replaced?: readonly string[];
  readonly removed?: readonly string[];
  readonly refused?: string;
}

export interface EventRec extends Rec {
  readonly name: string;
  /** The outcome of the skill, if the chart gives it another name. */
  readonly original?: string;
  readonly source: string;
  readonly attributes: Named;
}

export interface RuleRec extends Rec {
  readonly rule: string;
  readonly state: string;
}

export interface EndRec extends Rec {
  readonly finished: boolean;
  readonly reached?: boolean;
  readonly problem: string | null;
  readonly reason?: string;
  readonly programming_error?: string | null;
}

/** A fact as the language writes it. */
export function written(fact: Fact | readonly Value[]): string {
  return `(${fact.map(String).join(" ")})`;
}
