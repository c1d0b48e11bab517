/** The plan: what is done, at work, next; plans that ended are grey. */

import { useRef } from "react";
import { endOf, isFinished, kinOf, nextOf, SIGNS, type Plan, type PlanStep } from "../core/plans";
import type { PlanAskedRec, PlanNoneRec } from "../core/records";
import { lanesOf } from "../core/why";
import { session, useSelection } from "../session";
import { useCalmEffect, useMoment } from "../turn";
import { seconds } from "./Timeline";

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
        <Search />
        {plans.length === 0 && moment.search === null && <p className="quiet note">{`No plan has been made yet${moment.active.size ? ": all that was done was foreseen" : ""}.`}</p>}
        {shown.map(({ plan, number }, i) => (
          <PlanView key={`${number} ${plan.name}`} plan={plan} number={number} open={i === 0 || chosen === number} />
        ))}
        {plans.length > EARLIER && <p className="quiet note">{`${plans.length - EARLIER} earlier plans`}</p>}
      </div>
    </section>
  );
}

/** What is planned for just now, or why there is no plan. */
function Search() {
  const { search, t } = useMoment();
  if (search === null) return null;
  if (search.type === "plan.none") return <p className="note bad" role="status">{`no plan at ${seconds(search.t)}: ${(search as PlanNoneRec).reason}`}</p>;
  return (
    <div className="note" role="status">
      <p><b>planning …</b><span className="quiet">{` since ${seconds(t - search.t)}, for the goal`}</span></p>
      <code className="block">{(search as PlanAskedRec).goal}</code>
    </div>
  );
}

function PlanView({ plan, number, open }: { plan: Plan; number: number; open: boolean }) {
  const moment = useMoment();
  const finished = isFinished(plan);
  const done = plan.steps.filter((step) => step.state === "done").length;
  const end = endOf(plan);
  const past = plan.ended !== null || number < moment.plans.length - 1 && moment.running.get(plan.at ?? "-") !== number;
  const form = session.history.plots.get(moment.bound.get(plan.at ?? "-") ?? "");
  const lanes = open && form?.generated ? lanesOf(form, plan.names) : [];
  return (
    <article className={`one-plan ${past ? "past" : ""}`} aria-label={`${plan.name} ${end}`}>
      <button className="head" onClick={() => session.select({ kind: "plan", plan: number })}>
        <b>{plan.name}</b>
        <span className="strip" aria-hidden="true">
          {plan.steps.map((step, i) => <i key={i} className={step.state} />)}
        </span>
        <span className="quiet">{`${done}/${plan.steps.length}`}</span>
        {end && <span className={`badge ${finished ? "" : "bad"}`}>{end}</span>}
      </button>
      {open && !past && plan.at === null && <p className="note" role="status"><b>plan found</b><span className="quiet">{foundBy(plan)}</span></p>}
      {open && lanes.length > 1 && (
        <div className="lanes">
          {lanes.map((lane) => (
            <div key={lane.name} className="lane">
              <h3>{lane.name}</h3>
              <Steps plan={plan} number={number} which={lane.steps} lane={lane.name} />
            </div>
          ))}
        </div>
      )}
      {open && lanes.length <= 1 && <Steps plan={plan} number={number} which={plan.steps.map((_, i) => i)} />}
    </article>
  );
}

function foundBy({ engine, searched, steps }: Plan): string {
  return `: ${steps.length} steps${searched === null ? "" : ` in ${seconds(searched)}`}${engine ? `, by ${engine}` : ""}`;
}

function Steps({ plan, number, which, lane = "" }: { plan: Plan; number: number; which: readonly number[]; lane?: string }) {
  const next = nextOf(plan, which);
  const selection = useSelection();
  const chosen = selection?.kind === "step" && selection.plan === number ? selection.step : null;
  return (
    <ol>
      {which.map((i) => (
        <Step
          key={i} plan={number} number={i} step={plan.steps[i]!} next={i === next} lane={lane} chosen={i === chosen}
          kin={chosen === null ? null : kinOf(plan, i, chosen)}
        />
      ))}
    </ol>
  );
}

const KIN = { provider: "provides for the step selected", user: "relies on the step selected" } as const;

interface StepProps {
  readonly plan: number;
  readonly number: number;
  readonly step: PlanStep;
  readonly next: boolean;
  /** Who takes it, if the lane says so: that is not said again. */
  readonly lane: string;
  readonly chosen: boolean;
  readonly kin: "provider" | "user" | null;
}

function Step({ plan, number, step, next, lane, chosen, kin }: StepProps) {
  const moment = useMoment();
  const row = useRef<HTMLButtonElement>(null);
  const running = step.state === "running";
  useCalmEffect(() => {
    if (running) row.current?.scrollIntoView({ block: "nearest" });
  }, [running]);
  const state = next ? "next" : step.state;
  const taken = step.since === null ? null : (step.until ?? moment.t) - step.since;
  const [action, ...rest] = step.text.slice(1, -1).split(" ");
  return (
    <li>
      <button
        ref={row} className={`step ${state} ${kin ?? ""}`} aria-pressed={chosen} title={step.text}
        aria-label={`${number + 1} ${step.text}: ${state}${kin ? `, ${KIN[kin]}` : ""}`}
        onClick={() => session.select({ kind: "step", plan, step: number })}
      >
        <span className="sign" aria-hidden="true">{next ? "›" : SIGNS[step.state]}</span>
        <span className="number">{number + 1}</span>
        <span className="text"><b>{action}</b> <span className="args">{(rest[0] === lane ? rest.slice(1) : rest).join(" ")}</span></span>
        {kin && <span className={`kin ${kin}`} title={KIN[kin]}>{kin === "provider" ? "provides ↓" : "relies ↑"}</span>}
        {step.tries > 1 && <span className="badge" title={`begun ${step.tries} times`}>{`${step.tries}×`}</span>}
        {taken !== null && <span className="quiet">{`${taken.toFixed(1)} s`}</span>}
      </button>
    </li>
  );
}
