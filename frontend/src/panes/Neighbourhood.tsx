/** What is said of a thing, drawn: the thing in the middle, what it is related to around it. */

import { written } from "../core/records";
import type { Fact } from "../core/values";
import { session } from "../session";
import { useMoment } from "../turn";

interface Size {
  readonly wide: number;
  readonly high: number;
  /** So many things around it at most; more could not be told apart. */
  readonly most: number;
}

export const SMALL: Size = { wide: 340, high: 250, most: 12 };
export const LARGE: Size = { wide: 820, high: 480, most: 30 };

export function Neighbourhood({ about, size }: { about: string; size: Size }) {
  const { wide, high, most } = size;
  const moment = useMoment();
  const facts = [...moment.facts.values()].filter((fact) => fact.includes(about));
  const near = new Map<string, string[]>();
  for (const fact of facts) {
    for (const other of fact.slice(1).map(String)) {
      if (other !== about && moment.nodes.has(other)) near.set(other, [...(near.get(other) ?? []), relation(fact, about)]);
    }
  }
  const alone = facts.filter((fact) => fact.length === 2).map((fact) => String(fact[0]));
  const others = [...near].slice(0, most);
  return (
    <figure className="near" aria-label={`${about} and what it is related to`}>
      <figcaption>
        <b>{about}</b> <span className="quiet">{moment.nodes.get(about) ?? "not known"}</span>
        {alone.map((name) => <span key={name} className="badge">{name}</span>)}
        <button className="close" aria-label="Close" onClick={() => session.select(null)}>✕</button>
      </figcaption>
      {others.length > 0 && (
        <svg viewBox={`0 0 ${wide} ${high}`} role="group" aria-label={facts.map(written).join(" ")}>
          {others.map(([id, relations], i) => {
            const angle = (2 * Math.PI * i) / others.length - Math.PI / 2;
            const [x, y] = [wide / 2 + Math.cos(angle) * wide * 0.36, high / 2 + Math.sin(angle) * high * 0.39];
            return (
              <g key={id}>
                <line x1={wide / 2} y1={high / 2} x2={x} y2={y} />
                <text className="relation" x={(wide / 2 + x) / 2} y={(high / 2 + y) / 2}>{shortened(relations)}<title>{relations.join(", ")}</title></text>
                <Node id={id} x={x} y={y} />
              </g>
            );
          })}
          <g className="middle"><Node id={about} x={wide / 2} y={high / 2} /></g>
        </svg>
      )}
      {near.size > most && <p className="quiet">{`${near.size - most} more`}</p>}
    </figure>
  );
}

function Node({ id, x, y }: { id: string; x: number; y: number }) {
  const width = id.length * 6.6 + 14;
  const select = () => session.select({ kind: "thing", id });
  return (
    <g className="node" tabIndex={0} role="button" aria-label={id} onClick={select} onKeyDown={(event) => event.key === "Enter" && select()}>
      <rect x={x - width / 2} y={y - 10} width={width} height={20} rx={6} />
      <text x={x} y={y + 4}>{id}</text>
    </g>
  );
}

/** With an arrow that says whether the thing is the first argument. */
function relation(fact: Fact, about: string): string {
  return fact[1] === about ? `${fact[0]} →` : `← ${fact[0]}`;
}

function shortened(relations: readonly string[]): string {
  return relations.length > 2 ? `${relations[0]} +${relations.length - 1}` : relations.join(" ");
}
