/** The conditions that states watch, and those that they have watched, in the colours of their truth. */

import type { Condition } from "../core/conditions";
import { session } from "../session";
import { useMoment } from "../turn";
import { TRUTH } from "./parts";
import { seconds } from "./Timeline";

export function Conditions() {
  const { conditions } = useMoment();
  const all = [...conditions];
  const [watched, past] = [all.filter(([, one]) => one.ended === null), all.filter(([, one]) => one.ended !== null).reverse()];
  return (
    <>
      {watched.length > 0 && <section aria-label="Watched conditions"><h3>Watched conditions</h3>{watched.map(([seq, one]) => <One key={seq} seq={seq} one={one} />)}</section>}
      {past.length > 0 && (
        <details>
          <summary>{`${past.length} past conditions`}</summary>
          <section aria-label="Past conditions">{past.map(([seq, one]) => <One key={seq} seq={seq} one={one} />)}</section>
        </details>
      )}
    </>
  );
}

function One({ seq, one }: { seq: number; one: Condition }) {
  const parts = Object.entries(one.parts);
  const flips = one.last === null ? "" : ` · ${one.flips} ${one.flips === 1 ? "report" : "reports"}, the last at ${seconds(one.last)}`;
  return (
    <div className="tree watched">
      <Term text={one.text} truth={one.truth} />
      {parts.length > 1 && <div role="group">{parts.map(([text, truth]) => <Term key={text} text={text} truth={truth} />)}</div>}
      <p className="quiet">
        <button className="link" onClick={() => session.goTo(seq, { kind: "record", seq })}>{one.skill}</button>
        {` since ${seconds(one.since)}${one.ended === null ? "" : ` until ${seconds(one.ended)}`}${flips}`}
      </p>
    </div>
  );
}

function Term({ text, truth }: { text: string; truth: unknown }) {
  const [sign, said] = TRUTH.get(truth) ?? ["?", "unknown"];
  return (
    <div className={`leaf ${said}`} aria-label={`${text} is ${said}`}>
      <span className="sign" aria-hidden="true">{sign}</span>
      <code>{text}</code>
    </div>
  );
}
