// What screenshots, browser tests and the bench share: a program that serves a page, and Debian's Chromium to look at it.
import { execFileSync, spawn } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const ROOT = fileURLToPath(new URL("..", import.meta.url));
const DSC = process.env.DSC ?? join(ROOT, ".venv", "bin", "dsc");
const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";
/** What a stranger's name may be made to mean: this machine. */
export const OTHER_NAME = "rebound.example";
const FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
  "--disable-background-networking", "--disable-component-update", "--disable-sync", `--host-resolver-rules=MAP ${OTHER_NAME} 127.0.0.1`];

/** Start `dsc` with these arguments; answers the address that it prints, its lines of errors, and `stop`. */
export async function serve(...args) {
  const program = spawn(DSC, args, { stdio: ["ignore", "pipe", "pipe"] });
  const lines = createInterface({ input: program.stdout });
  const errors = [];
  createInterface({ input: program.stderr }).on("line", (line) => {
    console.error(line);
    errors.push(line);
  });
  const ended = new Promise((done) => program.once("exit", done));
  for await (const line of lines) {
    if (!line.startsWith("http://")) continue;
    lines.on("line", () => {}); // what else it prints must not fill the pipe
    return { url: line, errors, stop: () => stop(program, ended) };
  }
  throw new Error(`dsc ${args.join(" ")} ended without an address`);
}

/** As Ctrl-C does; what does not end by itself is ended. */
async function stop(program, ended) {
  program.kill("SIGINT");
  const patience = setTimeout(() => program.kill("SIGKILL"), 5000);
  await ended;
  clearTimeout(patience);
}

/** Record runs of the clean-up table with faults until one has a plan that breaks and a grasp from the side; its records. */
export async function record(path) {
  for (let seed = 1; seed <= MOST_SEEDS; seed++) {
    const args = ["run", "clean-up-table", "--trace", path, "--json", "--seed", String(seed), "--faults", "0.2"];
    const program = spawn(DSC, args, { stdio: ["ignore", "ignore", "inherit"] });
    await new Promise((done) => program.once("exit", done));
    const records = readFileSync(path, "utf8").trim().split("\n").slice(1).map((line) => JSON.parse(line));
    if (WANTED.every((is) => records.some(is))) return records;
  }
  throw new Error(`none of ${MOST_SEEDS} runs has all there is to show`);
}

const MOST_SEEDS = 30;
const WANTED = [
  (rec) => rec.type === "plan.broken",
  (rec) => rec.type === "decision" && rec.chosen === "pick_up_from_side",
  (rec) => rec.type === "decision" && rec.chosen === "stack",
];

/** Let `dsc` do something that ends by itself. */
export function run(...args) {
  return execFileSync(DSC, args, { encoding: "utf8" });
}

export async function browse() {
  if (!existsSync(CHROMIUM)) throw new Error(`no browser at ${CHROMIUM}: apt-get install chromium`);
  return chromium.launch({ executablePath: CHROMIUM, args: FLAGS });
}

/** A page at that address, with what it complains about collected. */
export async function open(browser, url, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, reducedMotion: "reduce", ...options });
  const page = await context.newPage();
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  await page.goto(url);
  return { page, complaints, context };
}

/** Until as many records are there. */
export async function loaded(page, count) {
  await page.waitForFunction((wanted) => Number(document.querySelector("input[type=range]")?.max ?? 0) >= wanted, count);
}

/** Show the moment after a record. */
export async function goTo(page, seq) {
  await page.getByLabel("Moment", { exact: true }).fill(String(seq));
  await settled(page);
}

/** Until the chart that belongs to the moment is drawn and nothing moves. */
export async function settled(page) {
  await page.waitForSelector(".react-flow__node .state.active");
  await page.waitForTimeout(700);
}

/** Click until it shows: a chart that is laid out at that moment may move its states from under the pointer. */
export async function clickUntil(button, shows, { tries = 4, timeout = 6000, ...state } = {}) {
  for (let left = tries; left > 0; left--) {
    if (await button.isVisible()) await button.click();
    const shown = shows.waitFor({ ...state, timeout: left === 1 ? 30_000 : timeout });
    if (await shown.then(() => true, (error) => { if (left === 1) throw error; })) return;
  }
}
