/** Why: what is selected and what led to it; with nothing selected, the last decision. */

import type { ActionRec, Rec } from "../core/records";
import { session, useSelection } from "../session";
import { useMoment } from "../turn";
import { Causes, RecordLink } from "./parts";
import { WhyPlan, WhyStep } from "./WhyPlan";
import { WhyRecord } from "./WhyRecord";
import { WhyState } from "./WhyState";

const LATELY = 14;

export function Why() {
  const moment = useMoment();
  const selection = useSelection();
  const { history } = session;
  if (selection?.kind === "state") return <Body close><WhyState path={selection.path} /></Body>;
  if (selection?.kind === "plan") return <Body close><WhyPlan number={selection.plan} /></Body>;
  if (selection?.kind === "step") return <Body close><WhyStep plan={selection.plan} number={selection.step} /></Body>;
  const rec = selection?.kind === "record" ? history.record(selection.seq) : undefined;
  if (rec && rec.seq <= moment.seq) {
    return <Body close><WhyRecord rec={rec} /><Causes seq={rec.seq} /></Body>;
  }
  const [decision] = history.before(moment.seq, "decision", 1);
  return (
    <Body>
      {decision && <WhyRecord rec={decision} />}
      <h3>What happened lately</h3>
      {moment.seq === 0 && <p className="quiet">Nothing yet.</p>}
      <ul className="records">{lately(moment.seq).map((one) => <li key={one.seq}><RecordLink rec={one} /></li>)}</ul>
    </Body>
  );
}

function lately(seq: number): Rec[] {
  const found: Rec[] = [];
  for (let at = seq; at > 0 && found.length < LATELY; at--) {
    const rec = session.history.record(at)!;
    if (rec.type !== "scene" && rec.type !== "plot" && rec.type !== "world" && !ofPlanner(rec)) found.push(rec);
  }
  return found;
}

/** An order that the planner gets for its bookkeeping; its plans have records of their own. */
function ofPlanner(rec: Rec): boolean {
  const { skill, port } = rec as ActionRec;
  return rec.type === "action" && (skill ?? port ?? "").startsWith("planner.");
}

function Body({ children, close = false }: { children: React.ReactNode; close?: boolean }) {
  return (
    <div className="scrolls why" role="tabpanel">
      {close && <button className="close" aria-label="Select nothing" title="Esc" onClick={() => session.select(null)}>✕</button>}
      {children}
    </div>
  );
}
