/** The answer to a question about the knowledge at a moment, asked when neither has changed for a while. */

import { useEffect, useState } from "react";
import type { Named } from "../core/values";
import { query, type Answer } from "./requests";

/** Milliseconds without a change before the program is asked. */
const CALM_MS = 150;

export interface Said {
  readonly answer?: Answer;
  readonly wrong?: string;
}

/** Null before the first answer; without `params` nothing is asked. */
export function useAnswer(seq: number, text: string, params: Named | null): Said | null {
  const [said, setSaid] = useState<Said | null>(null);
  const given = params && JSON.stringify(params);
  useEffect(() => {
    if (given === null) return setSaid(null);
    let wanted = true;
    const timer = setTimeout(() => {
      query(seq, text, JSON.parse(given) as Named).then(
        (answer) => wanted && setSaid({ answer }),
        (error: Error) => wanted && setSaid({ wrong: error.message }),
      );
    }, CALM_MS);
    return () => {
      wanted = false;
      clearTimeout(timer);
    };
  }, [seq, text, given]);
  return said;
}
