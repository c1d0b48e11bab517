/** All records there are, and the moment after any of them, in a few milliseconds either way. */

import { Observed } from "./components";
import { advance, beginning, copyOf, type Moment } from "./moment";
import { joinPath, type PlotForm } from "./plots";
import { whole } from "./reading";
import type { DecisionRec, EndRec, ObservationRec, PlotRec, Rec, StepRec } from "./records";
import { placeAfter } from "./search";
import { damaged, isDamaged, type Damaged } from "./sound";
import { stateWords } from "./words";

/** Records that are replayed at most to get to a moment. */
export const CHECKPOINT_EVERY = 500;

export type Mark = "failure" | "plan" | "decision" | "step" | "knowledge" | "scene";

const MARKS: ReadonlyMap<string, Mark> = new Map(Object.entries({
  damaged: "failure",
  rule: "failure",
  "plan.broken": "failure",
  "plan.none": "failure",
  "plan.wrong": "failure",
  "plan.gave_up": "failure",
  "plan.found": "plan",
  "plan.replaced": "plan",
  "plan.resumed": "plan",
  decision: "decision",
  step: "step",
  knowledge: "knowledge",
  scene: "scene",
} satisfies Record<string, Mark>));

export class History {
  readonly plots = new Map<string, PlotForm>();
  readonly marks: Readonly<Record<Mark, number[]>> = {
    failure: [], plan: [], decision: [], step: [], knowledge: [], scene: [],
  };
  /** Values of components over time. */
  readonly observed = new Observed();
  private readonly records: Rec[] = [];
  /** Path of a state -> when which plots became its content, in order. */
  private readonly bound = new Map<string, { seq: number; hash: string }[]>();
  private readonly checkpoints: Moment[] = [beginning()];
  /** The damaged records found so far. */
  readonly damages: Damaged[] = [];
  /** The record of the run's end. */
  end: EndRec | null = null;
  private tip = beginning();
  private kept = beginning();

  /** `noticed` is called when a record turns out to be damaged as it is first shown. */
  constructor(private readonly noticed: () => void = () => {}) {}

  /** Number of the last record. */
  get last(): number {
    return this.records.length;
  }

  /** Take in records that follow those that are there; what is there already is passed over. */
  append(from: number, records: readonly Rec[]): void {
    for (const given of records.slice(Math.max(0, this.last + 1 - from))) {
      if (given.seq !== this.last + 1) return;
      this.take(isDamaged(given) && !Number.isFinite(given.t) ? { ...given, t: this.tip.t } as Damaged : given);
      if (given.seq % CHECKPOINT_EVERY === 0) this.checkpoints.push(copyOf(this.tip));
    }
  }

  record(seq: number): Rec | undefined {
    const rec = this.records[seq - 1];
    const found = rec && (this.records[seq - 1] = whole(rec));
    if (found && found !== rec && isDamaged(found)) {
      this.damages.push(found);
      this.noticed();
    }
    return found;
  }

  private take(rec: Rec): void {
    this.records.push(rec);
    try {
      this.note(rec);
      advance(this.tip, rec, this.plots);
    } catch (error) { // sound by itself, but not after those before it: it is left out, here and when going back
      const left = damaged(rec.seq, `it does not follow from what was before (${String(error).slice(0, 120)})`, rec.type, rec.t);
      this.records[rec.seq - 1] = left;
      this.damages.push(left);
      this.tip = this.at(rec.seq);
    }
  }

  /** The moment after the record; nobody else holds it. */
  at(seq: number): Moment {
    const wanted = Math.max(0, Math.min(seq, this.last));
    const checkpoint = this.checkpoints[Math.min(Math.floor(wanted / CHECKPOINT_EVERY), this.checkpoints.length - 1)]!;
    const ahead = this.kept.seq <= wanted && this.kept.seq >= checkpoint.seq;
    const moment = ahead ? this.kept : copyOf(checkpoint);
    for (let next = moment.seq; next < wanted; next++) advance(moment, this.records[next]!, this.plots);
    this.kept = moment;
    return copyOf(moment);
  }

  /** The next marked record after `seq` (`way` 1) or before it (-1). */
  beside(seq: number, mark: Mark, way: 1 | -1): number | undefined {
    const marks = this.marks[mark];
    const place = placeAfter(marks, way > 0 ? seq : seq - 1, (one) => one);
    return way > 0 ? marks[place] : marks[place - 1];
  }

  /** The last marked records up to `seq`, the latest first. */
  before(seq: number, mark: Mark, most: number): Rec[] {
    const end = placeAfter(this.marks[mark], seq, (one) => one);
    const found = this.marks[mark].slice(Math.max(0, end - most), end).reverse();
    return found.map((one) => this.record(one)!);
  }

  /** The last decision of a dynamic state up to `seq`. */
  decisionOf(path: string, seq: number): DecisionRec | undefined {
    const { decision } = this.marks;
    for (let at = placeAfter(decision, seq, (one) => one) - 1; at >= 0; at--) {
      const found = this.record(decision[at]!) as DecisionRec;
      if (found.state === path) return found;
    }
    return undefined;
  }

  /** The last record at or before a time. */
  seqAt(t: number): number {
    return placeAfter(this.records, t, (one) => one.t);
  }

  /** The last plot up to `seq` in the state of that path. */
  plotIn(holder: string, seq: number): PlotForm | undefined {
    const hash = this.bound.get(holder)?.findLast((one) => one.seq <= seq)?.hash;
    return hash === undefined ? undefined : this.plots.get(hash);
  }

  /** The path of a state in words, as of a record. */
  words(path: string, seq: number): string {
    let holder = "";
    return path.split("/").map((name) => {
      const said = stateWords(this.plotIn(holder, seq), name);
      holder = joinPath(holder, name);
      return said;
    }).join("/");
  }

  /** A text of the program, with the states that it names in words. */
  inWords(text: string, seq: number): string {
    return text.replace(/(?<=\bstate ')[^']+(?=')/g, (path) => this.words(path, seq));
  }

  /** What led to a record, itself first. */
  causes(seq: number): Rec[] {
    const found: Rec[] = [];
    for (let rec = this.record(seq); rec && found.length < 12 && !found.includes(rec); rec = rec.cause === null ? undefined : this.record(rec.cause)) {
      found.push(rec);
    }
    return found;
  }

  private bind({ seq, microsteps }: StepRec): void {
    for (const { state, hash } of microsteps.flatMap((micro) => micro.bound ?? [])) {
      const known = this.bound.get(state);
      if (known) known.push({ seq, hash });
      else this.bound.set(state, [{ seq, hash }]);
    }
  }

  private note(rec: Rec): void {
    if (isDamaged(rec)) this.damages.push(rec);
    if (rec.type === "plot") {
      const { hash, plot, words } = rec as PlotRec;
      this.plots.set(hash, words ? { ...plot, words } : plot);
    }
    if (rec.type === "end") this.end = rec as EndRec;
    if (rec.type === "observation") this.observed.add(rec as ObservationRec);
    if (rec.type === "step") this.bind(rec as StepRec);
    const mark = MARKS.get(rec.type) ?? (rec.type === "end" && (rec as EndRec).problem ? "failure" : undefined);
    if (mark) this.marks[mark].push(rec.seq);
  }
}
