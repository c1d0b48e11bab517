/** A store of knowledge: what there is, by type, and what one thing is related to. */

import { session, useSelection } from "../session";
import { useMoment } from "../turn";
import { LARGE, Neighbourhood } from "./Neighbourhood";

/** Of one type, before the rest is only counted: the facts beside it can be filtered. */
const MOST = 60;

export function Graph() {
  const moment = useMoment();
  const selection = useSelection();
  const chosen = selection?.kind === "thing" && moment.nodes.has(selection.id) ? selection.id : null;
  const types = new Map<string, string[]>();
  for (const [id, type] of moment.nodes) types.set(type, [...(types.get(type) ?? []), id]);
  return (
    <section className="pane graph" aria-label="Graph">
      <h2>{`Knowledge at version ${moment.version}`}</h2>
      <div className="scrolls">
        {moment.nodes.size === 0 && <p className="quiet">Nothing is known yet.</p>}
        <dl className="things" aria-label="Things by type">
          {[...types].sort().map(([type, ids]) => (
            <div key={type} style={{ display: "contents" }}>
              <dt>{type}</dt>
              <dd>
                {ids.slice(0, MOST).map((id) => (
                  <button key={id} className="arg link" aria-pressed={id === chosen} onClick={() => session.select({ kind: "thing", id })}>{id}</button>
                ))}
                {ids.length > MOST && <span className="quiet">{`and ${ids.length - MOST} more`}</span>}
              </dd>
            </div>
          ))}
        </dl>
        {chosen === null ? moment.nodes.size > 0 && <p className="quiet">Choose a thing to see what it is related to.</p> : <Neighbourhood about={chosen} size={LARGE} />}
      </div>
    </section>
  );
}
