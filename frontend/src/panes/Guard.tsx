/** A guard in the colours of its truth at the shown moment, with the values that decide; as text if it cannot be asked. */

import { deciding } from "../core/explanations";
import { paramsOf } from "../core/guards";
import type { Named } from "../core/values";
import { useAnswer } from "../link/useAnswer";
import { Tree } from "./parts";

export function Guard({ text, seq, values }: { text: string; seq: number; values: Named }) {
  const why = useAnswer(seq, text, paramsOf(text, values))?.answer?.why;
  if (why === undefined) return <code className="block" title={text}>{text}</code>;
  return <div role="tree" aria-label={`Guard ${text}`}><Tree why={why} decider={deciding(why)} /></div>;
}
