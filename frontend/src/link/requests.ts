/** What the page asks the program beyond records. */

import { parsed } from "../core/reading";
import type { Explanation } from "../core/records";
import type { Fact, Named, Value } from "../core/values";

export interface Answer {
  readonly variables: readonly string[];
  readonly holds: boolean;
  readonly answers: readonly Readonly<Record<string, Value>>[];
  readonly version: number;
  /** There are other answers besides these. */
  readonly more?: boolean;
  readonly why?: Explanation;
}

export interface Known {
  readonly version: number;
  readonly things: Readonly<Record<string, string>>;
  readonly facts: readonly Fact[];
  readonly values: readonly (readonly Value[])[];
}

export interface Break {
  readonly number: number;
  readonly on: string;
}

export interface Obeyed {
  readonly ok: boolean;
  readonly breaks?: readonly Break[];
  /** Breakpoints that the run goes on without, each with the reason. */
  readonly dropped?: readonly string[];
}

export const query = (seq: number, expression: string, params: Named = {}) => ask<Answer>("query", { seq, expression, params });
export const control = (command: object) => ask<Obeyed>("control", command);

async function ask<T>(what: string, body: object): Promise<T> {
  return parsed(await (await post(what, body)).text()) as T;
}

async function post(what: string, body: object): Promise<Response> {
  const answer = await fetch(what, { method: "POST", body: JSON.stringify(body) });
  if (answer.ok) return answer;
  const text = await answer.text();
  throw new Error(errorIn(text) ?? text);
}

function errorIn(text: string): string | undefined {
  try {
    return (JSON.parse(text) as { error?: string }).error;
  } catch {
    return undefined;
  }
}
