/** The plan: what is done, at work, next; plans that were given up are grey. */

import { useEffect, useRef } from "react";
import { isFinished, nextStep, type Plan, type PlanStep } from "../core/plans";
import { lanesOf } from "../core/why";
import { session, useMoment, useSelection } from "../session";

const SIGNS = { waiting: "·", running: "▶", done: "✓", failed: "✕", skipped: "»", stopped: "■" } as const;
const EARLIER = 12;

export function PlanPane() {
  const moment = useMoment();
  const selection = useSelection();
  const plans = moment.plans.map((plan, number) => ({ plan, number }));
  const shown = plans.slice(-EARLIER).reverse();
  const chosen = selection?.kind === "plan" || selection?.kind === "step" ? selection.plan : null;
  return (
    <section className="pane plan" aria-label="Plan">
      <h2>Plan</h2>
      <div className="scrolls">
        {plans.length === 0 && <p className="quiet note">No plan has been made yet: all that was done was foreseen.</p>}
        {shown.map(({ plan, number }, i) => (
          <PlanView key={`${number} ${plan.name}`} plan={plan} number={number} open={i === 0 || chosen === number} />
        ))}
        {plans.length > EARLIER && <p className="quiet note">{`${plans.length - EARLIER} earlier plans`}</p>}
      </div>
    </section>
  );
}

function PlanView({ plan, number, open }: { plan: Plan; number: number; open: boolean }) {
  const moment = useMoment();
  const finished = isFinished(plan);
  const done = plan.steps.filter((step) => step.state === "done").length;
  const end = plan.ended === null ? "" : finished ? "carried out" : "given up";
  const form = session.history.plots.get(moment.bound.get(plan.at ?? "-") ?? "");
  const lanes = open && form?.generated ? lanesOf(form, plan.names) : [];
  return (
    <article className={`one-plan ${plan.ended === null ? "" : "past"}`} aria-label={`${plan.name} ${end}`}>
      <button className="head" onClick={() => session.select({ kind: "plan", plan: number })}>
        <b>{plan.name}</b>
        <span className="strip" aria-hidden="true">
          {plan.steps.map((step, i) => <i key={i} className={step.state} />)}
        </span>
        <span className="quiet">{`${done}/${plan.steps.length}`}</span>
        {end && <span className={`badge ${finished ? "" : "bad"}`}>{end}</span>}
      </button>
      {open && lanes.length > 1 && (
        <div className="lanes">
          {lanes.map((lane) => (
            <div key={lane.name} className="lane">
              <h3>{lane.name}</h3>
              <Steps plan={plan} number={number} which={lane.steps} />
            </div>
          ))}
        </div>
      )}
      {open && lanes.length <= 1 && <Steps plan={plan} number={number} which={plan.steps.map((_, i) => i)} />}
    </article>
  );
}

function Steps({ plan, number, which }: { plan: Plan; number: number; which: readonly number[] }) {
  const next = nextStep(plan);
  return (
    <ol>
      {which.map((i) => (
        <Step key={i} plan={number} number={i} step={plan.steps[i]!} next={i === next} />
      ))}
    </ol>
  );
}

function Step({ plan, number, step, next }: { plan: number; number: number; step: PlanStep; next: boolean }) {
  const moment = useMoment();
  const selection = useSelection();
  const row = useRef<HTMLButtonElement>(null);
  const running = step.state === "running";
  useEffect(() => {
    if (running) row.current?.scrollIntoView({ block: "nearest" });
  }, [running]);
  const state = next ? "next" : step.state;
  const taken = step.since === null ? null : (step.until ?? moment.t) - step.since;
  const chosen = selection?.kind === "step" && selection.plan === plan && selection.step === number;
  const [action, ...rest] = step.text.slice(1, -1).split(" ");
  return (
    <li>
      <button
        ref={row} className={`step ${state}`} aria-pressed={chosen} aria-label={`${number + 1} ${step.text}: ${state}`}
        onClick={() => session.select({ kind: "step", plan, step: number })}
      >
        <span className="sign" aria-hidden="true">{next ? "›" : SIGNS[step.state]}</span>
        <span className="number">{number + 1}</span>
        <span className="text"><b>{action}</b> {rest.join(" ")}</span>
        {step.tries > 1 && <span className="badge" title={`begun ${step.tries} times`}>{`${step.tries}×`}</span>}
        {taken !== null && <span className="quiet">{`${taken.toFixed(1)} s`}</span>}
      </button>
    </li>
  );
}
