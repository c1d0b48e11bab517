// What `make bench-viewer` measures with Node and Chromium; prints one JSON object.
//   node bench.mjs layout                 milliseconds to lay out charts of 30, 150 and 500 states
//   node bench.mjs open TRACE RECORDS     how long the page takes to open a long trace, and to get to its moments
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { browse, loaded, open, serve } from "./browser.mjs";

const here = fileURLToPath(new URL(".", import.meta.url));
const ROUNDS = 5;
const JUMPS = 200;
const SECONDS = 4;

const [what, ...rest] = process.argv.slice(2);
console.log(JSON.stringify(what === "layout" ? await layouts() : await opened(rest[0], Number(rest[1]))));

/** The page's own layout, built for Node. */
async function layouts() {
  const { build } = await import("vite");
  const outDir = join(here, "node_modules", ".bench");
  mkdirSync(outDir, { recursive: true });
  const entry = join(here, "src", "chart", "layout.ts");
  await build({ root: here, configFile: false, logLevel: "error", build: { ssr: entry, outDir, emptyOutDir: true } });
  const { layout } = await import(pathToFileURL(join(outDir, "layout.js")).href);
  const { default: ELK } = await import("elkjs/lib/elk.bundled.js");
  const elk = new ELK();
  const found = {};
  for (const count of [30, 150, 500]) {
    const chart = nested(count);
    await layout(elk, chart); // the engine is warm from here on
    const times = [];
    for (let round = 0; round < ROUNDS; round++) {
      const start = performance.now();
      await layout(elk, chart);
      times.push(performance.now() - start);
    }
    found[count] = median(times);
  }
  return found;
}

/** Composites of ten states, each a chain with a way back, the composites a chain as well. */
function nested(count) {
  const nodes = [];
  const edges = [];
  const node = (id, parent, expandable) => nodes.push({
    id, parent, kind: expandable ? "composite" : "simple", name: id, about: undefined, content: null, generated: false,
    initial: false, expandable, expanded: expandable, active: false, hidden: 0, ways: 0,
  });
  const edge = (from, to, label) => edges.push({ id: `${from}>${to}`, from, to, labels: [label], rule: false, quiet: false, via: [`${from}>${to}`] });
  for (let group = 0; nodes.length < count; group++) {
    const around = `group_${group}`;
    node(around, null, true);
    if (group > 0) edge(`group_${group - 1}`, around, "done");
    for (let i = 0; i < 9 && nodes.length < count; i++) {
      node(`state_${group}_${i}`, around, false);
      if (i > 0) edge(`state_${group}_${i - 1}`, `state_${group}_${i}`, "done");
      if (i === 5) edge(`state_${group}_${i}`, `state_${group}_0`, "failed");
    }
  }
  return { nodes, edges };
}

async function opened(trace, count) {
  const program = await serve("view", trace, "--no-open");
  const browser = await browse();
  try {
    const { first, all } = await unwatched(browser, program.url, count);
    const { page } = await open(browser, program.url);
    await page.waitForSelector(".react-flow__node .state");
    await loaded(page, count);
    const jumps = await page.evaluate(scrub, { count, jumps: JUMPS });
    const frames = await page.evaluate(dragged, { count, seconds: SECONDS });
    const drawn = await page.evaluate(played, SECONDS);
    return { first, all, jump: median(jumps), slowest: nearlyAll(jumps), frame: median(frames), slowestFrame: nearlyAll(frames), drawn };
  } finally {
    await browser.close();
    await program.stop();
  }
}

/**
 * Milliseconds until the first moment is drawn, and until all records are there, in a tab of its own: of a page that
 * Playwright drives the browser hands on each message to it, which takes longer than anything that the page does.
 */
async function unwatched(browser, url, count) {
  const tab = await tabOf(browser);
  const start = performance.now();
  await tab("Page.navigate", { url });
  const until = async (expression) => {
    while (!(await tab("Runtime.evaluate", { expression, returnByValue: true })).result.value) await new Promise((done) => setTimeout(done, 10));
    return performance.now() - start;
  };
  const first = await until(`document.querySelector(".react-flow__node .state") !== null`);
  const all = await until(`Number(document.querySelector("input[type=range]").max) >= ${count}`);
  await tab("Page.close");
  return { first, all };
}

/** A tab that Playwright does not know; answers how to send it a command of the browser's protocol. */
async function tabOf(browser) {
  const link = await browser.newBrowserCDPSession();
  const { browserContextId } = await link.send("Target.createBrowserContext");
  const { targetId } = await link.send("Target.createTarget", { url: "about:blank", browserContextId, width: 1280, height: 720 });
  const { sessionId } = await link.send("Target.attachToTarget", { targetId, flatten: false });
  const waiting = new Map();
  link.on("Target.receivedMessageFromTarget", ({ message }) => {
    const { id, result } = JSON.parse(message);
    waiting.get(id)?.(result);
  });
  return (method, params = {}) => new Promise((done) => {
    const id = waiting.size + 1;
    waiting.set(id, done);
    void link.send("Target.sendMessageToTarget", { sessionId, message: JSON.stringify({ id, method, params }) });
  });
}

/** In the page: go to moments all over the run, each drawn before the next; milliseconds from asking to drawing. */
async function scrub({ count, jumps }) {
  const slider = document.querySelector("input[type=range]");
  const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  const drawn = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  const times = [];
  for (let i = 1; i <= jumps; i++) {
    const seq = (i * 7919 * 13) % count;
    const start = performance.now();
    set.call(slider, String(seq));
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    times.push(performance.now() - start);
    await drawn();
  }
  return times;
}

/** In the page: the scrubber dragged from one end to the other, a bit with each frame; milliseconds between frames. */
async function dragged({ count, seconds }) {
  const slider = document.querySelector("input[type=range]");
  const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  const frame = () => new Promise(requestAnimationFrame);
  const times = [];
  let before = await frame();
  for (const start = before; before - start < 1000 * seconds;) {
    set.call(slider, String(Math.round((count * (before - start)) / (1000 * seconds))));
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    const now = await frame();
    times.push(now - before);
    before = now;
  }
  return times;
}

/** In the page: how often a second another moment is drawn while the run is played so fast that each frame has one. */
async function played(seconds) {
  const slider = document.querySelector("input[type=range]");
  const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  set.call(slider, "1000");
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  const speed = document.querySelector("select[aria-label=Speed]");
  speed.value = "100";
  speed.dispatchEvent(new Event("change", { bubbles: true }));
  document.querySelector("button[aria-label=Play]").click();
  let drawn = 0;
  let shown = slider.value;
  const end = performance.now() + 1000 * seconds;
  while (performance.now() < end) {
    await new Promise(requestAnimationFrame);
    if (slider.value !== shown) drawn += 1;
    shown = slider.value;
  }
  return drawn / seconds;
}

function nearlyAll(numbers) {
  return [...numbers].sort((a, b) => a - b)[Math.floor(0.95 * numbers.length)];
}

function median(numbers) {
  return [...numbers].sort((a, b) => a - b)[Math.floor(numbers.length / 2)];
}
