/** A guard in the colours of its truth at the shown moment, with the values that decide; as text if it cannot be asked. */

import { useEffect, useState } from "react";
import { deciding } from "../core/explanations";
import { paramsOf } from "../core/guards";
import type { Explanation, Named } from "../core/records";
import { query } from "../link/requests";
import { Tree } from "./parts";

/** Milliseconds without another moment before the program is asked. */
const CALM_MS = 150;

export function Guard({ text, seq, values }: { text: string; seq: number; values: Named }) {
  const [why, setWhy] = useState<Explanation | null>(null);
  const given = paramsOf(text, values);
  const params = given && JSON.stringify(given);
  useEffect(() => {
    let shown = true;
    if (params === null) return setWhy(null);
    const asking = setTimeout(() => {
      query(seq, text, JSON.parse(params) as Named).then((answer) => shown && setWhy(answer.why ?? null), () => shown && setWhy(null));
    }, CALM_MS);
    return () => { shown = false; clearTimeout(asking); };
  }, [text, seq, params]);
  if (why === null) return <code className="block" title={text}>{text}</code>;
  return <div role="tree" aria-label={`Guard ${text}`}><Tree why={why} decider={deciding(why)} /></div>;
}
