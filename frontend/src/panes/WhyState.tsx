/** A state: since when, with which parameters and variables, and why its content was chosen. */

import { splitPath, statesOf, type PlotForm, type StateForm } from "../core/plots";
import type { Named } from "../core/values";
import { eventWords, stateWords } from "../core/words";
import { session } from "../session";
import { useMoment } from "../turn";
import { Guard } from "./Guard";
import { Values } from "./parts";
import { Links } from "./WhyPlan";
import { seconds } from "./Timeline";
import { Decision } from "./WhyRecord";

export function WhyState({ path }: { path: string }) {
  const moment = useMoment();
  const { history } = session;
  const [holder, name] = splitPath(path);
  const plot = history.plots.get(moment.bound.get(holder) ?? "");
  const state = plot && statesOf(plot).find((one) => one.name === name);
  const since = moment.active.get(path);
  const content = history.plots.get(moment.bound.get(path) ?? "");
  const plan = moment.running.get(holder);
  const step = plan === undefined ? undefined : moment.plans[plan]!.names.get(name);
  const decision = state?.kind === "dynamic" ? history.decisionOf(path, moment.seq) : undefined;
  return (
    <div aria-label="State">
      <div className="what">
        <span className="quiet">{`${state?.kind ?? "state"} in ${plot?.plot ?? "a plot that does not run now"}`}</span>
        <p><b>{stateWords(plot, name)}</b>{since ? ` · active for ${seconds(moment.t - since.t)}` : " · not active"}</p>
        {state?.form.about && <p className="quiet">{state.form.about}</p>}
      </div>
      {state?.form.goal && <><h3>Goal</h3><code className="block">{state.form.goal}</code></>}
      {plan !== undefined && step !== undefined && <Links at={plan} number={step} />}
      {content && <Running path={path} content={content} />}
      {moment.variables.has(holder) && <><h3>{`Variables of ${plot?.plot ?? "its plot"}`}</h3><Values values={used(moment.variables.get(holder)!)} words={plot?.words?.variables} /></>}
      {decision !== undefined && <><h3>Decision</h3><Decision rec={decision} /></>}
      {state && plot && <Leads form={state.form} plot={plot} values={since ? moment.variables.get(holder) ?? {} : null} seq={moment.seq} />}
    </div>
  );
}

function Running({ path, content }: { path: string; content: PlotForm }) {
  const moment = useMoment();
  return (
    <>
      <h3>{`Inside: ${content.plot}${content.generated ? " (generated)" : ""}`}</h3>
      {content.about && <p className="quiet">{content.about}</p>}
      {content.when && <p>when <code>{content.when}</code></p>}
      <Values values={used(moment.variables.get(path) ?? {})} words={content.words?.variables} />
    </>
  );
}

/** A generated plot counts the tries of every rule; those at nothing say nothing. */
function used(values: Named): Named {
  return Object.fromEntries(Object.entries(values).filter(([name, value]) => !(name.startsWith("tries_") && value === 0)));
}

/** `values` are the variables of an active state, whose guards are asked; null for another one. */
function Leads({ form, plot, values, seq }: { form: StateForm; plot: PlotForm; values: Named | null; seq: number }) {
  const ways = [...Object.entries(form.on ?? {}), ["after", form.after ?? []] as const, ["always", form.always ?? []] as const]
    .flatMap(([on, found]) => found.map((way) => ({ on, ...way })));
  if (ways.length === 0) return null;
  return (
    <>
      <h3>Leads to</h3>
      <ul className="plain">
        {ways.map((way, i) => (
          <li key={i}>
            <b>{eventWords(plot, way.on)}</b>{way.seconds !== undefined && ` ${way.seconds} s`}{" → "}{way.to === undefined ? "stays" : stateWords(plot, way.to)}
            {way.rule && <span className="badge">{`rule ${way.rule}`}</span>}
            {way.when && (values === null ? <code className="block" title={way.when}>{way.when}</code> : <Guard text={way.when} seq={seq} values={values} />)}
          </li>
        ))}
      </ul>
    </>
  );
}
