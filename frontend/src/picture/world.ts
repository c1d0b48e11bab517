/** The world as it is drawn in its pane, with its colours written out: another program has not got the page's styles. */

import type { Part } from "./sheet";

const WIDTH = 330;
const WRITTEN = ["fill", "stroke", "stroke-width", "stroke-dasharray", "stroke-linecap", "font-size", "paint-order", "transform"] as const;

export function worldPart(drawn: SVGSVGElement | null): Part {
  const box = drawn?.viewBox.baseVal;
  if (!drawn || !box || box.width === 0) return { width: 0, height: 0, body: "" };
  const height = (WIDTH * box.height) / box.width;
  const made = onPaper(() => written(drawn));
  made.setAttribute("width", String(WIDTH));
  made.setAttribute("height", String(height));
  return { width: WIDTH, height, body: new XMLSerializer().serializeToString(made) };
}

/** In light colours, also while the page is dark. */
function onPaper<T>(act: () => T): T {
  const { style } = document.documentElement;
  style.colorScheme = "light";
  try {
    return act();
  } finally {
    style.removeProperty("color-scheme");
  }
}

function written(drawn: SVGSVGElement): SVGSVGElement {
  const made = drawn.cloneNode(true) as SVGSVGElement;
  const from = [...drawn.querySelectorAll("*")];
  [...made.querySelectorAll("*")].forEach((one, i) => {
    if (one.tagName === "title") return;
    const styles = getComputedStyle(from[i]!);
    const said = WRITTEN.map((name) => [name, styles.getPropertyValue(name)]).filter(([name, value]) => value && !(value === "none" && name !== "fill"));
    one.setAttribute("style", said.map(([name, value]) => `${name}:${value}`).join(";"));
    for (const name of ["class", "tabindex", "role"]) one.removeAttribute(name);
  });
  for (const name of ["class", "role"]) made.removeAttribute(name);
  return made;
}
