/** A plan: why it ended. A step of it: what it provides to whom, what it needs, what it changed. */

import { endOf, isFinished, type Plan } from "../core/plans";
import { joinPath } from "../core/plots";
import type { PlanFoundRec } from "../core/records";
import { changesBetween, conditionsInto } from "../core/why";
import { session } from "../session";
import { useMoment } from "../turn";
import { Causes, changed, Facts, RecordLink } from "./parts";
import { seconds } from "./Timeline";
import { Decision, WhyRecord } from "./WhyRecord";

export function WhyPlan({ number }: { number: number }) {
  const moment = useMoment();
  const { history } = session;
  const plan = moment.plans[number];
  if (!plan) return <p className="quiet">At this moment the plan had not been made yet.</p>;
  const found = history.record(plan.seq) as PlanFoundRec;
  const end = plan.ended === null ? undefined : history.record(plan.ended);
  const follower = moment.plans[number + 1];
  return (
    <div aria-label="Plan">
      <div className="what">
        <span className="quiet">{`plan · ${seconds(found.t)}${plan.engine ? ` · ${plan.engine}` : ""}`}</span>
        <p><b>{plan.name}</b>{`, ${plan.steps.length} steps, ${plan.steps.filter((step) => step.state === "done").length} done`}</p>
      </div>
      {end && !isFinished(plan) && (
        <>
          <h3>{`Why it was ${endOf(plan)}`}</h3>
          <WhyRecord rec={end} />
          <Causes seq={end.seq} />
        </>
      )}
      {follower && <><h3>Then</h3><ul className="records"><li><RecordLink rec={history.record(follower.seq)!} /></li></ul></>}
      <h3>Where it came from</h3>
      <ul className="records"><li><RecordLink rec={found} /></li></ul>
      <Causes seq={plan.seq} />
    </div>
  );
}

export function WhyStep({ plan: at, number }: { plan: number; number: number }) {
  const moment = useMoment();
  const plan = moment.plans[at];
  const step = plan?.steps[number];
  if (!plan || !step) return <p className="quiet">At this moment the plan had not been made yet.</p>;
  const name = [...plan.names].find(([, which]) => which === number)?.[0];
  return (
    <div aria-label="Step of the plan">
      <div className="what">
        <span className="quiet">{`step ${number + 1} of ${plan.name} · ${step.state}`}</span>
        <p><code>{step.text}</code></p>
      </div>
      <Links at={at} number={number} />
      {plan.links.length === 0 && name !== undefined && <Needed plan={plan} name={name} />}
      <Brought plan={plan} number={number} />
      {name !== undefined && <HowDone plan={plan} name={name} />}
    </div>
  );
}

/** What it provides to whom, and who provides what it needs: the plan's causal links, if the record has them. */
export function Links({ at, number }: { at: number; number: number }) {
  const { facts, plans } = useMoment();
  const plan = plans[at]!;
  const who = (one: number) => {
    if (one === 0) return "what holds already";
    if (one > plan.steps.length) return "the goal";
    const select = () => session.select({ kind: "step", plan: at, step: one - 1 });
    return <button className="link" onClick={select}>{`${one} ${plan.steps[one - 1]!.text}`}</button>;
  };
  const comes = (one: number) => ["waiting", "running"].includes(plan.steps[one - 1]?.state ?? "");
  const provides = plan.links.filter(([provider]) => provider === number + 1);
  const needs = plan.links.filter(([, , user]) => user === number + 1);
  if (plan.links.length === 0) return null;
  return (
    <>
      <h3>Provides</h3>
      {provides.length === 0 && <p className="quiet">nothing that the plan needs</p>}
      <ul className="plain links">{provides.map(([, fact, user], i) => <li key={i}><Shortly fact={fact} /><span>{"for "}{who(user)}</span></li>)}</ul>
      <h3>Relies on</h3>
      {needs.length === 0 && <p className="quiet">nothing that could change</p>}
      <ul className="plain links">{needs.map(([provider, fact], i) => <li key={i}><Shortly fact={fact} holds={comes(provider) ? null : holdsNow(fact, facts)} /><span>{"from "}{who(provider)}</span></li>)}</ul>
    </>
  );
}

/** Of `(imply IF THEN)`, as goals have them, the end says enough. */
function Shortly({ fact, holds = null }: { fact: string; holds?: boolean | null }) {
  const then = fact.startsWith("(imply ") ? /\([^()]*\)\)$/.exec(fact)?.[0] : undefined;
  const text = then === undefined ? fact : `… ${then.slice(0, -1)}`;
  return <code title={fact} className={String(holds)}>{holds === null ? text : `${holds ? "✓" : "✕"} ${text}`}</code>;
}

/** Of a fact or its negation; what else there may be is not judged here. */
function holdsNow(text: string, facts: ReadonlyMap<string, unknown>): boolean | null {
  const negated = /^\(not (\([^()]*\))\)$/.exec(text)?.[1];
  if (negated) return !facts.has(negated);
  return /^\([^()<>=]*\)$/.test(text) ? facts.has(text) : null;
}

function Needed({ plan, name }: { plan: Plan; name: string }) {
  const moment = useMoment();
  const plot = session.history.plots.get(moment.bound.get(plan.at ?? "-") ?? "");
  const conditions = plot?.generated ? conditionsInto(plot, name) : [];
  if (conditions.length === 0) return null;
  const facts = conditions.flatMap((text) => text.match(/\((?:not \([^()]*\)|[^()]+)\)/g) ?? [text]);
  return (
    <>
      <h3>Begins once</h3>
      <ul className="facts">
        {facts.map((fact) => {
          const holds = holdsNow(fact, moment.facts) ?? false;
          return <li key={fact} className={holds ? "true" : "false"}><code>{`${holds ? "✓" : "✕"} ${fact}`}</code></li>;
        })}
      </ul>
    </>
  );
}

function Brought({ plan, number }: { plan: Plan; number: number }) {
  const moment = useMoment();
  const step = plan.steps[number]!;
  if (step.since === null) return null;
  const changes = changesBetween(session.history, plan.seq, step.since, step.until ?? moment.t).filter((one) => one.seq <= moment.seq);
  return (
    <>
      <h3>Changed while it ran</h3>
      {changes.length === 0 && <p className="quiet">nothing yet</p>}
      {changes.map((change) => (
        <div key={change.seq}>
          <Facts title="" sign="−" facts={changed(change).removed} />
          <Facts title="" sign="+" facts={changed(change).added} />
        </div>
      ))}
    </>
  );
}

function HowDone({ plan, name }: { plan: Plan; name: string }) {
  const moment = useMoment();
  const path = joinPath(plan.at ?? "", name);
  const made = session.history.decisionOf(path, moment.seq);
  return made && made.seq > plan.seq ? <><h3>How it is done</h3><Decision rec={made} /></> : null;
}
