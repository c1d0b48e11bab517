/** Which run this is, and how it stands. */

import { endsWell, endWords } from "../core/ends";
import { session, useShown } from "../session";
import { stopWords } from "./Controls";
import { Help } from "./Help";

export function Header() {
  const { header, live, connected, paused, moment, last, expected } = useShown();
  const facts = ["seed", "faults", "began"].filter((name) => header[name] !== undefined).map((name) => `${name} ${String(header[name])}`);
  const working = [...moment.working.values()].filter((one) => one.skill && !one.skill.startsWith("planner."))
    .map((one) => (one.for ? `${one.skill} (waits for ${one.for})` : one.skill));
  return (
    <header>
      <strong>{String(header.run ?? "a run")}</strong>
      <span className="quiet">{facts.join(" · ")}</span>
      {live ? <span className="badge live">live</span> : <End />}
      {paused && <span className="badge bad">stands still: {stopWords(paused, moment.seq)}</span>}
      {!connected && <span className="badge bad">not connected</span>}
      {last < expected && <span className="quiet" role="status">{`${last} of ${expected} records`}</span>}
      {moment.search?.type === "plan.asked" && <span className="badge plans">planning …</span>}
      <span className="working" aria-label="Skills at work">
        {working.length > 0 && `at work: ${working.join(", ")}`}
      </span>
      <Help />
    </header>
  );
}

/** How a recorded run ended, whatever moment is shown. */
function End() {
  const { last, expected, connected } = useShown();
  const { end } = session.history;
  if (session.kind === "store" || !connected || last === 0 || last < expected) return <span className="badge">recorded</span>;
  return (
    <button className={`badge end ${endsWell(end) ? "live" : "bad"}`} title="To the end" onClick={() => session.goTo(last)}>
      {session.history.inWords(endWords(end), last)}
    </button>
  );
}

/** Damaged records that are named; the rest is counted. */
const NAMED = 3;

/** What is not as it should be with the trace, in words: nothing is passed over in silence. */
export function Notice() {
  const { wrong, live, last, expected, connected } = useShown();
  const { damages } = session.history;
  const empty = connected && !live && last === 0 && expected === 0;
  if (wrong === null && damages.length === 0 && !empty) return null;
  return (
    <div className="notice" role="alert">
      {wrong !== null && <p>{wrong}</p>}
      {empty && <p>There are no records: the trace ends after its first line.</p>}
      {damages.slice(0, NAMED).map((rec) => (
        <p key={rec.seq}>
          <button className="link" onClick={() => session.goTo(rec.seq, { kind: "record", seq: rec.seq })}>{`Record ${rec.seq}`}</button>
          {` (line ${rec.line}) is damaged: ${rec.why}.`}
        </p>
      ))}
      {damages.length > NAMED && <p>{`${damages.length - NAMED} more records are damaged.`}</p>}
      {damages.length > 0 && <p className="quiet">The rest is shown; what these records changed is missing from there on.</p>}
    </div>
  );
}
