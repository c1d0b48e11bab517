/** What the keys do and what the colours say. */

import { useRef } from "react";

const KEYS = [
  ["space", "play, pause"],
  ["← →", "one step back, one step on"],
  ["shift ← →", "one record back, one record on"],
  ["[ ]", "to the failure before, after"],
  ["{ }", "to the plan before, after"],
  [", .", "to the decision before, after"],
  ["Home End", "to the beginning, to the end (a live run is followed again)"],
  ["Esc", "select nothing"],
] as const;

const SIGNS = [
  ["blue", "active now; transitions and states of the last steps fade"],
  ["dashed, hatched", "a plot that was made from a plan; all others were designed"],
  ["◆ ▣", "a dynamic state, whose content was chosen; a submachine"],
  ["✓ ✕ ?", "true, false, not known; done and failed in a plan"],
  ["← 12", "so many transitions lead here that are drawn only when the state is selected"],
  ["+ − ⤢", "open, close, zoom into a state"],
] as const;

export function Help() {
  const dialog = useRef<HTMLDialogElement>(null);
  return (
    <>
      <button className="help" aria-label="Keys and signs" onClick={() => dialog.current?.showModal()}>?</button>
      <dialog ref={dialog} aria-label="Keys and signs">
        <dl>{KEYS.map(([key, what]) => <div key={key} style={{ display: "contents" }}><dt><kbd>{key}</kbd></dt><dd>{what}</dd></div>)}</dl>
        <dl>{SIGNS.map(([sign, what]) => <div key={sign} style={{ display: "contents" }}><dt><b>{sign}</b></dt><dd>{what}</dd></div>)}</dl>
        <form method="dialog"><button className="help">Close</button></form>
      </dialog>
    </>
  );
}
