/** A live run in the hands of who watches it, where that was allowed: hold it, stop it at places, hand things in. */

import { useCallback, useEffect, useState } from "react";
import { control, type Break } from "../link/requests";
import { useShown } from "../session";

const KINDS = [["state", "clear/execute"], ["event", "grasp_failed"], ["condition", "(holding cup1)"], ["plan_step", "(drive table sink)"]] as const;

export function Controls() {
  const { paused, live, selection } = useShown();
  const [breaks, setBreaks] = useState<readonly Break[]>([]);
  const [wrong, setWrong] = useState("");
  const send = useCallback((command: object) => {
    control(command).then((said) => {
      setWrong("");
      if (said.breaks) setBreaks(said.breaks);
    }, (error: Error) => setWrong(error.message));
  }, []);
  useEffect(() => send({ do: "breaks" }), [send]);
  const path = selection?.kind === "state" ? selection.path : null;
  return (
    <div className="scrolls control" role="tabpanel">
      {wrong && <p className="bad note" role="alert">{wrong}</p>}
      {!live && <p className="quiet">The run is over.</p>}
      <h3>The run</h3>
      <div className="row">
        <button onClick={() => send({ do: "pause" })}>Hold it</button>
        <button onClick={() => send({ do: "step" })}>One step</button>
        <button onClick={() => send({ do: "resume" })}>Go on</button>
      </div>
      <p className="quiet">{paused ? `It stands still: ${paused}.` : "Holding it is not pausing the time line: the robot waits."}</p>
      <h3>Stand still at</h3>
      <ul className="plain">
        {breaks.map((one) => (
          <li key={one.number}>{one.on} <button aria-label={`Remove ${one.on}`} onClick={() => send({ do: "unbreak", number: one.number })}>✕</button></li>
        ))}
      </ul>
      {path !== null && <button onClick={() => send({ do: "break", on: { state: path } })}>{`the selected state ${path}`}</button>}
      <Choice kinds={KINDS} act={(kind, text) => send({ do: "break", on: { [kind]: text } })} verb="Add" />
      <h3>Hand in</h3>
      <Choice
        kinds={[["event", "stop"], ["tell", "(missing cup1)"], ["retract", "(missing cup1)"]]} verb="Send"
        act={(kind, text) => send(kind === "event" ? { do: "event", name: text, attributes: {} } : { do: kind, statements: [text] })}
      />
    </div>
  );
}

interface ChoiceProps {
  readonly kinds: readonly (readonly [string, string])[];
  readonly act: (kind: string, text: string) => void;
  readonly verb: string;
}

function Choice({ kinds, act, verb }: ChoiceProps) {
  const [kind, setKind] = useState(kinds[0]![0]);
  const [text, setText] = useState("");
  const example = kinds.find(([name]) => name === kind)?.[1];
  const submit = (event: React.FormEvent) => {
    event.preventDefault();
    if (text.trim()) act(kind, text.trim());
  };
  return (
    <form className="row" onSubmit={submit}>
      <select aria-label={`${verb}: what`} value={kind} onChange={(event) => setKind(event.target.value)}>
        {kinds.map(([name]) => <option key={name} value={name}>{name.replace("_", " ")}</option>)}
      </select>
      <input aria-label={`${verb}: which`} placeholder={example} value={text} spellCheck={false} onChange={(event) => setText(event.target.value)} />
      <button>{verb}</button>
    </form>
  );
}
