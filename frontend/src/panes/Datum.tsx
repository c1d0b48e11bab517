/** Data that a reference such as `data:9f86d081884c7d65.png` names: a picture, a plot of numbers, or a link. */

import { useEffect, useState } from "react";
import { fileName } from "../core/references";

const PICTURE = /\.(png|jpe?g|gif|webp|bmp|svg)$/;

/** Size of a plot, and the most numbers that it draws. */
const [WIDTH, HEIGHT, MOST] = [240, 60, 2000];

export function Datum({ reference }: { reference: string }) {
  const address = `data/${fileName(reference)}`;
  const [gone, setGone] = useState(false);
  if (gone) return <span className="quiet" title="Start with --data FOLDER to see it.">{`${reference}, not in the folder of data`}</span>;
  if (PICTURE.test(reference)) return <a href={address} target="_blank" rel="noreferrer"><img className="datum" src={address} alt={reference} onError={() => setGone(true)} /></a>;
  if (reference.endsWith(".json")) return <Plot reference={reference} address={address} onGone={() => setGone(true)} />;
  return <a href={address} download>{reference}</a>;
}

function Plot({ reference, address, onGone }: { reference: string; address: string; onGone: () => void }) {
  const [numbers, setNumbers] = useState<readonly number[] | null>(null);
  useEffect(() => {
    let shown = true;
    numbersAt(address).then((found) => shown && setNumbers(found), () => shown && onGone());
    return () => { shown = false; };
  }, [address]);
  const link = <a href={address} target="_blank" rel="noreferrer">{reference}</a>;
  if (numbers === null || numbers.length < 2) return link;
  return (
    <a href={address} target="_blank" rel="noreferrer">
      <svg className="datum" role="img" aria-label={`${reference}: ${numbers.length} numbers`} width={WIDTH} height={HEIGHT} viewBox={`0 0 ${WIDTH} ${HEIGHT}`}>
        <polyline points={pointsOf(numbers)} fill="none" stroke="currentColor" />
      </svg>
      <span className="quiet">{`${numbers.length} numbers, ${Math.min(...numbers).toPrecision(3)} to ${Math.max(...numbers).toPrecision(3)}`}</span>
    </a>
  );
}

/** The list of numbers at an address, thinned out; empty for other data. */
async function numbersAt(address: string): Promise<readonly number[]> {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error("gone");
  const found: unknown = await answer.json();
  if (!Array.isArray(found) || !found.every((one) => typeof one === "number")) return [];
  const each = Math.ceil(found.length / MOST);
  return (found as number[]).filter((_, i) => i % each === 0);
}

export function pointsOf(numbers: readonly number[]): string {
  const [least, most] = [Math.min(...numbers), Math.max(...numbers)];
  const [across, up] = [WIDTH / (numbers.length - 1), most > least ? (HEIGHT - 4) / (most - least) : 0];
  return numbers.map((one, i) => `${(i * across).toFixed(1)},${(HEIGHT - 2 - (one - least) * up).toFixed(1)}`).join(" ");
}
