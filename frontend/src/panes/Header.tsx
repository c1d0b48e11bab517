/** Which run this is, and how it stands. */

import { useShown } from "../session";
import { Help } from "./Help";

export function Header() {
  const { header, live, connected, paused, moment, last, expected } = useShown();
  const facts = ["seed", "faults", "began"].filter((name) => header[name] !== undefined).map((name) => `${name} ${String(header[name])}`);
  const working = [...moment.working.values()].map((one) => one.skill).filter((skill) => skill && !skill.startsWith("planner."));
  return (
    <header>
      <strong>{String(header.run ?? "a run")}</strong>
      <span className="quiet">{facts.join(" · ")}</span>
      <span className={`badge ${live ? "live" : ""}`}>{live ? "live" : "recorded"}</span>
      {paused && <span className="badge bad">stands still: {paused}</span>}
      {!connected && <span className="badge bad">not connected</span>}
      {last < expected && <span className="quiet" role="status">{`${last} of ${expected} records`}</span>}
      <span className="working" aria-label="Skills at work">
        {working.length > 0 && `at work: ${working.join(", ")}`}
      </span>
      <Help />
    </header>
  );
}
