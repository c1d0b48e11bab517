/** A live run in the hands of who watches it, where that was allowed: hold it, stop it at places, hand things in. */

import { useCallback, useEffect, useId, useState } from "react";
import { eventIn } from "../core/handed";
import { control, type Break } from "../link/requests";
import { session, useShown } from "../session";
import { useMoment } from "../turn";

const KINDS = [["state", "clear/execute"], ["event", "grasp_failed"], ["condition", "(holding cup1)"], ["plan_step", "(drive table sink)"]] as const;

export function Controls() {
  const { paused, live, selection } = useShown();
  const [breaks, setBreaks] = useState<readonly Break[]>([]);
  const [dropped, setDropped] = useState<readonly string[]>([]);
  const [wrong, setWrong] = useState("");
  const send = useCallback((command: object) => {
    control(command).then((said) => {
      setWrong("");
      if (said.breaks) setBreaks(said.breaks);
      setDropped(said.dropped ?? []);
    }, (error: Error) => setWrong(error.message));
  }, []);
  useEffect(() => send({ do: "breaks" }), [send]);
  const moment = useMoment();
  const { active, plans } = moment;
  const path = selection?.kind === "state" ? selection.path : null;
  const step = selection?.kind === "step" ? plans[selection.plan]?.steps[selection.step]?.text : undefined;
  const known = { state: [...active.keys()], plan_step: plans.at(-1)?.steps.map((step) => step.text) ?? [] };
  return (
    <fieldset className="scrolls control" role="tabpanel" disabled={!live}>
      {wrong && <p className="bad note" role="alert">{wrong}</p>}
      {!live && <p className="quiet">The run is over.</p>}
      <h3>The run</h3>
      <div className="row">
        <button onClick={() => send({ do: "pause" })}>Hold it</button>
        <button onClick={() => send({ do: "step" })}>One step</button>
        <button onClick={() => send({ do: "resume" })}>Go on</button>
      </div>
      <p className="quiet">{paused ? `It stands still: ${stopWords(paused, moment.seq)}.` : "Holding it is not pausing the time line: the robot waits."}</p>
      <h3>Stand still at</h3>
      <ul className="plain">
        {breaks.map((one) => (
          <li key={one.number}>{stopWords(one.on, moment.seq)} <button aria-label={`Remove ${stopWords(one.on, moment.seq)}`} onClick={() => send({ do: "unbreak", number: one.number })}>✕</button></li>
        ))}
      </ul>
      {dropped.map((one) => <p key={one} className="bad note" role="status">{`Dropped: ${one}`}</p>)}
      {path !== null && <button onClick={() => send({ do: "break", on: { state: path } })}>{`Add the selected state ${session.history.words(path, moment.seq)}`}</button>}
      {step !== undefined && <button onClick={() => send({ do: "break", on: { plan_step: step } })}>{`Add the selected step ${step}`}</button>}
      <Choice kinds={KINDS} known={known} act={(kind, text) => send({ do: "break", on: { [kind]: text } })} verb="Add" wrong={setWrong} />
      <h3>Hand in</h3>
      <Choice
        kinds={[["event", "low level=0.2"], ["tell", "(missing cup1)"], ["retract", "(missing cup1)"]]} verb="Send" wrong={setWrong}
        act={(kind, text) => send(kind === "event" ? { do: "event", ...eventIn(text) } : { do: kind, statements: [text] })}
      />
    </fieldset>
  );
}

/** Why a run stands still, with a state in words. */
export function stopWords(why: string, seq: number): string {
  return why.startsWith("state ") ? `state ${session.history.words(why.slice("state ".length), seq)}` : why;
}

interface ChoiceProps {
  /** Of a kind, what there is. */
  readonly known?: Readonly<Record<string, readonly string[]>>;
  readonly kinds: readonly (readonly [string, string])[];
  readonly act: (kind: string, text: string) => void;
  readonly verb: string;
  readonly wrong: (why: string) => void;
}

function Choice({ kinds, known = {}, act, verb, wrong }: ChoiceProps) {
  const list = useId();
  const [kind, setKind] = useState(kinds[0]![0]);
  const [text, setText] = useState("");
  const example = kinds.find(([name]) => name === kind)?.[1];
  const submit = (event: React.FormEvent) => {
    event.preventDefault();
    if (!text.trim()) return;
    try {
      act(kind, text.trim());
    } catch (error) {
      wrong((error as Error).message);
    }
  };
  return (
    <form className="row" onSubmit={submit}>
      <select aria-label={`${verb}: what`} value={kind} onChange={(event) => setKind(event.target.value)}>
        {kinds.map(([name]) => <option key={name} value={name}>{name.replace("_", " ")}</option>)}
      </select>
      <input aria-label={`${verb}: which`} placeholder={example} list={list} value={text} spellCheck={false} onChange={(event) => setText(event.target.value)} />
      <datalist id={list}>{(known[kind] ?? []).map((one) => <option key={one} value={one} />)}</datalist>
      <button>{verb}</button>
    </form>
  );
}
