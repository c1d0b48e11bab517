/** A drawing to be kept: parts side by side on white, with a caption; ink that prints, whatever the page looks like. */

export interface Part {
  readonly width: number;
  readonly height: number;
  /** SVG, from (0, 0) to (width, height). */
  readonly body: string;
}

export const INK = {
  ink: "#1b2027", quiet: "#5b6470", line: "#9aa2af", blue: "#0072b2", soft: "#dcecf7", green: "#007a5a", red: "#b84a00", purple: "#a5497a",
};

const MARGIN = 16;
const CAPTION = 26;
const STYLE = `text{font:13px system-ui,"DejaVu Sans",sans-serif;fill:${INK.ink}} .small{font-size:11px;fill:${INK.quiet}}
.label{font-size:10.5px;fill:${INK.quiet};text-anchor:middle;paint-order:stroke;stroke:#fff;stroke-width:3px} .bold{font-weight:650}`;
const DEFS = `<defs>${tip("tip", INK.line)}${tip("taken", INK.blue)}
<pattern id="plan" width="9" height="9" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="9" height="9" fill="#fff"/><path d="M0 0v9" stroke="#faeef4" stroke-width="2"/></pattern></defs>`;

export function sheet(part: Part, caption: string): string {
  const [width, height] = [Math.ceil(part.width) + 2 * MARGIN, Math.ceil(part.height) + 2 * MARGIN + CAPTION];
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" height="${height}">
<title>${escaped(caption)}</title><style>${STYLE}</style>${DEFS}
<rect width="100%" height="100%" fill="#fff"/><text class="small" x="${MARGIN}" y="20">${escaped(caption)}</text>
${placed(part, MARGIN, MARGIN + CAPTION)}</svg>
`;
}

export function below(...parts: readonly Part[]): Part {
  return put(parts, (_, { height }) => [0, height + 2 * MARGIN]);
}

export function beside(...parts: readonly Part[]): Part {
  return put(parts, (_, { width }) => [width + 2 * MARGIN, 0]);
}

/** One after the other, each from where `next` says, with the extent of those before. */
function put(parts: readonly Part[], next: (part: Part, before: Part) => [number, number]): Part {
  return parts.filter((part) => part.body).reduce((before, part) => {
    const [x, y] = before.body ? next(part, before) : [0, 0];
    return { width: Math.max(before.width, x + part.width), height: Math.max(before.height, y + part.height), body: before.body + placed(part, x, y) };
  }, { width: 0, height: 0, body: "" });
}

function placed({ body }: Part, x: number, y: number): string {
  return `<g transform="translate(${x} ${y})">\n${body}\n</g>\n`;
}

/** Squeezed where it would not fit: another machine may have wider letters. */
export function text(said: string, x: number, y: number, most: number, style = ""): string {
  const wide = said.length * (style.includes("small") ? 6.2 : 7.4) > most ? ` textLength="${most}" lengthAdjust="spacingAndGlyphs"` : "";
  return `<text class="${style}" x="${x}" y="${y}"${wide}>${escaped(said)}</text>`;
}

/** Characters that no XML may have, however they are written. */
// eslint-disable-next-line no-control-regex
const NO_XML = /[\u0000-\u0008\u000b\u000c\u000e-\u001f\ufffe\uffff\p{Surrogate}]/gu;

function tip(id: string, fill: string): string {
  return `<marker id="${id}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto" markerUnits="userSpaceOnUse"><path d="M0 0.5 8 4 0 7.5z" fill="${fill}"/></marker>`;
}

export function escaped(said: string): string {
  return said.replace(NO_XML, "\ufffd").replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");
}
