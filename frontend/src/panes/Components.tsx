/** The components of a run: what each one does, its mode, its wires, its waits, and its observed values over time. */

import type { ComponentState, Point } from "../core/components";
import { lineOf } from "../core/components";
import { session } from "../session";
import { useMoment } from "../turn";
import { Conditions } from "./Conditions";
import { jsonOf } from "./parts";
import { seconds } from "./Timeline";

const LINE = { width: 100, height: 20 };

export function Components() {
  const moment = useMoment();
  const { observed } = session.history;
  const names = [...new Set([...moment.components.keys(), ...observed.names])].sort();
  return (
    <div className="scrolls components" role="tabpanel">
      <Conditions />
      {names.length === 0 && <p className="quiet">No component has been used yet.</p>}
      {names.map((name) => <One key={name} name={name} state={moment.components.get(name)} />)}
    </div>
  );
}

function One({ name, state }: { name: string; state: ComponentState | undefined }) {
  const moment = useMoment();
  const working = [...moment.working].filter(([, one]) => one.skill?.split(".")[0] === name);
  const wires = Object.entries(state?.wires ?? {});
  const observed = session.history.observed.of(name, moment.seq);
  return (
    <section className="component" aria-label={name}>
      <h3>
        <span className="name">{name}</span>
        {state?.mode && <span className="badge">{state.mode}</span>}
        {working.map(([seq, one]) => (
          <button key={seq} className="badge live" onClick={() => session.goTo(seq, { kind: "record", seq })}>
            {`${one.skill!.split(".").slice(1).join(".")}${one.for ? ` waits for ${one.for}` : ""}`}
          </button>
        ))}
      </h3>
      {state?.waits && <p className="bad">{`waits: ${state.waits}`}</p>}
      {wires.length > 0 && (
        <table className="values" aria-label={`Wires of ${name}`}>
          <tbody>
            {wires.map(([port, provider]) => (
              <tr key={port}><th scope="row">{port}</th><td>{provider === null ? <span className="bad">not wired</span> : `← ${provider}`}</td></tr>
            ))}
          </tbody>
        </table>
      )}
      {observed.length > 0 && (
        <table className="values" aria-label={`Values of ${name}`}>
          <tbody>{observed.map(([entry, points]) => <Values key={entry} entry={entry} points={points} end={moment.t} />)}</tbody>
        </table>
      )}
    </section>
  );
}

function Values({ entry, points, end }: { entry: string; points: readonly Point[]; end: number }) {
  const last = points.at(-1)!;
  const line = lineOf(points, end, LINE);
  const text = typeof last.value === "string" ? last.value : jsonOf(last.value);
  return (
    <tr>
      <th scope="row">{entry}</th>
      <td className={entry === "problem" && last.value !== null ? "bad" : ""} title={`since ${seconds(last.t)}, ${points.length} observations`}>{text}</td>
      <td>
        {line !== null && points.length > 1 && (
          <svg className="over-time" viewBox={`0 -2 ${LINE.width} ${LINE.height + 4}`} width={LINE.width} height={LINE.height + 4} role="img" aria-label={`${entry} over time`}>
            <path d={line} />
          </svg>
        )}
      </td>
    </tr>
  );
}
