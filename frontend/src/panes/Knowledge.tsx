/** What is known: facts with a filter in the one language, what changed, what is said of a thing. */

import { useMemo, useState } from "react";
import { deciding } from "../core/explanations";
import { written, type KnowledgeRec } from "../core/records";
import type { Fact, Value } from "../core/values";
import { useAnswer } from "../link/useAnswer";
import { session, useKind, useSelection } from "../session";
import { useMoment } from "../turn";
import { Neighbourhood, SMALL } from "./Neighbourhood";
import { changed, RecordLink, Tree } from "./parts";

const MOST = 300;
const CHANGES = 25;
const NO_PARAMS = {};
const VIEWS = ["facts", "changes"] as const;

export function Knowledge() {
  const moment = useMoment();
  const selection = useSelection();
  const [view, setView] = useState<(typeof VIEWS)[number]>("facts");
  const [text, setText] = useState("");
  const thing = selection?.kind === "thing" ? selection.id : null;
  const kind = useKind();
  const asking = text.trim().startsWith("(");
  return (
    <div className="scrolls knowledge" role="tabpanel">
      {thing !== null && kind !== "store" && <Neighbourhood about={thing} size={SMALL} />}
      <input
        type="search" aria-label="Filter or ask" placeholder={`a word, or ${example(moment.facts)}`} value={text}
        spellCheck={false} onChange={(event) => setText(event.target.value)}
      />
      {asking ? <Answers seq={moment.seq} text={text} /> : (
        <>
          <div className="switch" role="group" aria-label="Show">
            {VIEWS.map((name) => <button key={name} aria-pressed={view === name} onClick={() => setView(name)}>{name}</button>)}
            <span className="quiet">{`version ${moment.version} · ${moment.facts.size} facts`}</span>
          </div>
          {view === "facts" ? <Table word={text.trim()} about={thing} /> : <Feed />}
        </>
      )}
    </div>
  );
}

/** A question that has an answer. */
function example(facts: ReadonlyMap<string, Fact>): string {
  for (const [name, thing, other] of facts.values()) if (thing !== undefined && other !== undefined) return `(${name} ?x ${other})`;
  return "(on ?x table)";
}

function Table({ word, about }: { word: string; about: string | null }) {
  const moment = useMoment();
  const [latest] = session.history.before(moment.seq, "knowledge", 1) as KnowledgeRec[];
  const fresh = useMemo(() => new Set(latest ? changed(latest).added : []), [latest]);
  const rows = useMemo(() => {
    const facts: (Fact | readonly Value[])[] = [...moment.facts.values(), ...moment.values.values()];
    const wanted = facts.filter((fact) => (about === null || fact.includes(about)) && (word === "" || written(fact).includes(word)));
    return wanted.sort((a, b) => (written(a) < written(b) ? -1 : 1));
  }, [moment, word, about]);
  return (
    <table className="known" aria-label="Facts">
      <tbody>
        {rows.slice(0, MOST).map((fact) => (
          <tr key={written(fact)} className={fresh.has(written(fact)) ? "fresh" : ""}>
            <th scope="row">{String(fact[0])}</th>
            <td>{fact.slice(1).map((arg, i) => <Thing key={i} id={String(arg)} known={moment.nodes.has(String(arg))} />)}</td>
          </tr>
        ))}
        {rows.length > MOST && <tr><td colSpan={2} className="quiet">{`${rows.length - MOST} more`}</td></tr>}
      </tbody>
    </table>
  );
}

export function Thing({ id, known }: { id: string; known: boolean }) {
  if (!known) return <span className="arg">{id}</span>;
  return <button className="arg link" onClick={() => session.select({ kind: "thing", id })}>{id}</button>;
}

function Feed() {
  const moment = useMoment();
  const changes = session.history.before(moment.seq, "knowledge", CHANGES) as KnowledgeRec[];
  return (
    <ul className="records feed" aria-label="Changes">
      {changes.map((rec) => (
        <li key={rec.seq}>
          <RecordLink rec={rec} />
        </li>
      ))}
    </ul>
  );
}

/** What the program answers, asked anew for each moment. */
function Answers({ seq, text }: { seq: number; text: string }) {
  const said = useAnswer(seq, text, NO_PARAMS);
  if (said === null) return null;
  if (said.answer === undefined) return <p className="bad note" role="alert">{said.wrong}</p>;
  const { answer } = said;
  return (
    <div aria-label="Answers" aria-live="polite">
      <p><b>{answer.variables.length ? `${answer.answers.length} answers${answer.more ? ", and there are more" : ""}` : answer.holds ? "true" : "false"}</b><span className="quiet">{` · version ${answer.version}`}</span></p>
      {answer.why && <div role="tree" aria-label="Why"><Tree why={answer.why} decider={deciding(answer.why)} /></div>}
      {answer.variables.length > 0 && (
        <table className="known">
          <thead><tr>{answer.variables.map((name) => <th key={name} scope="col">{`?${name}`}</th>)}</tr></thead>
          <tbody>
            {answer.answers.slice(0, MOST).map((one, i) => (
              <tr key={i}>{answer.variables.map((name) => <td key={name}><Thing id={Object.hasOwn(one, name) ? String(one[name]) : "?"} known /></td>)}</tr>
            ))}
          </tbody>
        </table>
      )}
    </div>
  );
}

