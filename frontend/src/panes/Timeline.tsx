/** One scrubber over all panes, with marks where something failed, was planned or was decided. */

import { useEffect, useRef } from "react";
import type { Mark } from "../core/history";
import { session, SPEEDS, useKind, useShown } from "../session";

const JUMPS: readonly (readonly [Mark, string, string, string])[] = [
  ["failure", "failure", "[", "]"],
  ["plan", "plan", "{", "}"],
  ["decision", "decision", ",", "."],
];

export function Timeline() {
  const { moment, last, playing, following, speed, live } = useShown();
  const kind = useKind();
  const going = playing || following;
  return (
    <footer aria-label="Time">
      <div className="buttons">
        <button aria-label="To the beginning" title="Home" onClick={() => session.goTo(0)}><Icon d="M3 2v12M13 2 5 8l8 6z" /></button>
        <button aria-label="One step back" title="←" onClick={() => session.step(-1)}><Icon d="M11 3 4 8l7 5z" /></button>
        <button className="play" aria-label={going ? "Pause" : "Play"} title="space" onClick={() => session.play(!going)}>
          <Icon d={going ? "M4 2h3v12H4zM9 2h3v12H9z" : "m4 2 10 6-10 6z"} />
        </button>
        <button aria-label="One step on" title="→" onClick={() => session.step(1)}><Icon d="m5 3 7 5-7 5z" /></button>
        <button aria-label="To the end" title="End" onClick={() => session.goTo(session.history.last)}>
          {live && "live "}<Icon d="M13 2v12M3 2l8 6-8 6z" />
        </button>
        <label className="speed">
          <span className="quiet">speed</span>
          <select aria-label="Speed" value={speed} onChange={(event) => session.speed(Number(event.target.value))}>
            {SPEEDS.map((one) => (
              <option key={one} value={one}>{`${one}×`}</option>
            ))}
          </select>
        </label>
      </div>
      <div className="scrubber">
        <Marks last={last} />
        <input
          type="range" aria-label="Moment" min={0} max={last} value={moment.seq}
          aria-valuetext={`record ${moment.seq} of ${last}, ${seconds(moment.t)}`}
          onChange={(event) => session.goTo(Number(event.target.value))}
        />
      </div>
      <output className="clock" aria-label="Time of the run">
        <b>{seconds(moment.t)}</b> <span className="quiet">{`${moment.seq} / ${last}`}</span>
      </output>
      {kind !== "store" && <div className="jumps">
        {JUMPS.map(([mark, name, back, on]) => (
          <span key={mark} className={`jump ${mark}`}>
            <button aria-label={`Previous ${name}`} title={back} onClick={() => session.jump(mark, -1)}>‹</button>
            {name}
            <button aria-label={`Next ${name}`} title={on} onClick={() => session.jump(mark, 1)}>›</button>
          </span>
        ))}
      </div>}
    </footer>
  );
}

function Icon({ d }: { d: string }) {
  return <svg className="icon" viewBox="0 0 16 16" aria-hidden="true"><path d={d} /></svg>;
}

const ROWS: readonly (readonly [Mark, number, number])[] = [["decision", 0, 4], ["plan", 4, 8], ["failure", 10, 8]];

/** Marks per pixel, not per record: there may be 100,000 of them. */
function Marks({ last }: { last: number }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const made = canvas.current;
    const pen = made?.getContext("2d");
    if (!made || !pen) return;
    const draw = () => {
      const scale = devicePixelRatio;
      const width = made.clientWidth;
      made.width = width * scale;
      made.height = made.clientHeight * scale;
      pen.scale(scale, scale);
      for (const [mark, y, height] of ROWS) {
        made.style.color = `var(--${mark})`; // as a colour that a canvas knows: it is told of no variables
        pen.fillStyle = getComputedStyle(made).color;
        const at = new Set(session.history.marks[mark].map((seq) => Math.round((seq / Math.max(1, last)) * (width - 16)) + 8));
        for (const x of at) pen.fillRect(x - 1, y, 2, height);
      }
    };
    draw();
    const sizes = new ResizeObserver(draw);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    sizes.observe(made);
    dark.addEventListener("change", draw);
    return () => {
      sizes.disconnect();
      dark.removeEventListener("change", draw);
    };
  }, [last]);
  return <canvas ref={canvas} className="marks" aria-hidden="true" />;
}

export function seconds(t: number): string {
  return t < 100 ? `${t.toFixed(1)} s` : `${Math.floor(t / 60)} min ${String(Math.floor(t % 60)).padStart(2, "0")} s`;
}
