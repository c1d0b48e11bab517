/** A record in full: a decision with its candidates, a broken plan with who broke it, others as they are. */

import { useMemo } from "react";
import { deciding } from "../core/explanations";
import { splitPath } from "../core/plots";
import type { Candidate, DecisionRec, KnowledgeRec, PlanBrokenRec, PlanFoundRec, Rec, RuleRec, StepRec } from "../core/records";
import type { Value } from "../core/values";
import type { Damaged } from "../core/sound";
import { referencesIn } from "../core/references";
import { breaker } from "../core/why";
import { eventWords } from "../core/words";
import { session } from "../session";
import { Datum } from "./Datum";
import { CELL, changed, Facts, inPath, inShort, jsonOf, RecordLink, Tree, Values } from "./parts";

export function WhyRecord({ rec }: { rec: Rec }) {
  const references = useMemo(() => referencesIn(rec), [rec]);
  return (
    <>
      <Body rec={rec} />
      {references.length > 0 && <h3>Data</h3>}
      {references.map((one) => <div key={one}><Datum reference={one} /></div>)}
    </>
  );
}

function Body({ rec }: { rec: Rec }) {
  switch (rec.type) {
    case "decision": return <Decision rec={rec as DecisionRec} />;
    case "plan.broken": return <Broken rec={rec as PlanBrokenRec} />;
    case "plan.found": return <Found rec={rec as PlanFoundRec} />;
    case "knowledge": return <Change rec={rec as KnowledgeRec} />;
    case "step": return <StepTaken rec={rec as StepRec} />;
    case "rule": return <Rule rec={rec as RuleRec} />;
    case "damaged": return <Lost rec={rec as Damaged} />;
    default: return <Plain rec={rec} />;
  }
}

function Head({ rec, children }: { rec: Rec; children: React.ReactNode }) {
  return (
    <div className="what">
      <span className="quiet">{`${rec.type} · record ${rec.seq}`}</span>
      <p>{children}</p>
    </div>
  );
}

export function Decision({ rec }: { rec: DecisionRec }) {
  return (
    <div aria-label="Decision">
      <Head rec={rec}>
        <button className="link" onClick={() => session.select({ kind: "state", path: rec.state })}>{inPath(rec, rec.state)}</button>
        {rec.satisfied ? " had nothing to do: its goal holds." : rec.chosen === null ? ": no candidate fits." : <>{" chose "}<b>{rec.chosen}</b></>}
        {rec.by && <span className="quiet">{` by ${rec.by}`}</span>}
        {rec.version !== undefined && <span className="quiet">{` · knowledge version ${rec.version}`}</span>}
      </Head>
      <Values values={rec.arguments ?? {}} />
      {rec.chosen === "achieve" && <p className="quiet">No designed candidate fits, and there is a goal: a plan is asked for.</p>}
      <div role="tree" aria-label="Candidates">
        {(rec.candidates ?? []).map((one) => <CandidateView key={one.plot} one={one} chosen={one.plot === rec.chosen} by={rec.by} />)}
      </div>
    </div>
  );
}

function CandidateView({ one, chosen, by }: { one: Candidate; chosen: boolean; by: string | undefined }) {
  const verdict = chosen ? "chosen" : one.fits ? "fits" : "rejected";
  return (
    <div className={`candidate ${verdict}`} aria-label={`${one.plot}: ${verdict}`}>
      <div className="head">
        <b>{one.plot}</b>
        <span className={`badge ${one.fits ? "" : "bad"}`}>{verdict}</span>
        {one.learned !== undefined ? <span className="quiet">{one.learned}</span> : one.score !== undefined && <span className="quiet">{`${by ?? "score"} ${one.score}`}</span>}
      </div>
      {one.condition.text === undefined ? <p className="quiet">{one.reason}</p> : <Tree why={one.condition} decider={deciding(one.condition)} />}
    </div>
  );
}

function Broken({ rec }: { rec: PlanBrokenRec }) {
  const change = breaker(session.history, rec);
  return (
    <div aria-label="Broken plan">
      <Head rec={rec}>The plan no longer leads to the goal.</Head>
      <Facts title="The fact that broke it" sign="✕" facts={[rec.link?.fact ? `${rec.link.fact}` : rec.reason]} />
      {rec.link && <p>needed by {rec.link.user}</p>}
      <h3>Who changed it</h3>
      <p><b>{change?.author ?? rec.author}</b>{change && change.author !== rec.author && <span className="quiet">{` (${rec.author})`}</span>}</p>
      {change && <ul className="records"><li><RecordLink rec={change} /></li></ul>}
    </div>
  );
}

function Rule({ rec }: { rec: RuleRec }) {
  return (
    <Head rec={rec}>
      <b>{rec.rule}</b> at <button className="link" onClick={() => session.select({ kind: "state", path: rec.state })}>{inPath(rec, rec.state)}</button>
    </Head>
  );
}

function Found({ rec }: { rec: PlanFoundRec }) {
  return (
    <>
      <Head rec={rec}><b>{rec.plot}</b>{`, ${rec.steps.length} steps${rec.engine ? `, by ${rec.engine}` : ""}`}</Head>
      <ol className="plain">{rec.steps.map((step, i) => <li key={i}><code>{step}</code></li>)}</ol>
    </>
  );
}

function Change({ rec }: { rec: KnowledgeRec }) {
  const { added, removed } = changed(rec);
  return (
    <>
      <Head rec={rec}><b>{rec.author}</b>{` · version ${rec.version}`}</Head>
      <Facts title="" sign="−" facts={removed} />
      <Facts title="" sign="+" facts={added} />
    </>
  );
}

function StepTaken({ rec }: { rec: StepRec }) {
  const taken = rec.microsteps.flatMap((micro) => micro.taken);
  return (
    <>
      <Head rec={rec}>{taken.length} transitions, run to completion</Head>
      <ol className="plain">
        {taken.map((one, i) => (
          <li key={i}><code>{inPath(rec, one.from)}</code>{" "}<b>{eventWords(session.history.plotIn(splitPath(one.from)[0], rec.seq), one.on)}</b>{" → "}<code>{one.to === null ? "stays" : inPath(rec, one.to).split("/").at(-1)}</code></li>
        ))}
      </ol>
    </>
  );
}

function Lost({ rec }: { rec: Damaged }) {
  return (
    <div aria-label="Damaged record">
      <Head rec={rec}>{`Line ${rec.line} of the trace is damaged: ${rec.why}. What it changed is missing from here on.`}</Head>
      <h3>What stands there</h3>
      <code className="block">{rec.text}</code>
    </div>
  );
}

function Plain({ rec }: { rec: Rec }) {
  const { seq: _seq, t: _t, type: _type, cause: _cause, ...rest } = rec;
  return (
    <>
      <Head rec={rec}>{inShort(rec)}</Head>
      <table className="values">
        <tbody>{Object.entries(rest).map(([name, value]) => <tr key={name}><th scope="row">{name}</th><td>{said(value as Value)}</td></tr>)}</tbody>
      </table>
    </>
  );
}

function said(value: Value): string {
  return typeof value === "string" && value.length <= CELL ? value : jsonOf(value);
}
