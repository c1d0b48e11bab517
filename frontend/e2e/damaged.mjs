// Damaged, odd and hostile traces in the browser: the page says what is damaged, shows the rest, and is never blank.
import assert from "node:assert/strict";
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browse, clickUntil, loaded, open, record, serve } from "../browser.mjs";

const folder = mkdtempSync(join(tmpdir(), "dsc-"));
const NAMES = ["constructor", "__proto__", "toString", "hasOwnProperty"];
let browser, header, lines;

before(async () => {
  const trace = join(folder, "run.jsonl");
  await record(trace);
  [header, ...lines] = readFileSync(trace, "utf8").trimEnd().split("\n");
  browser = await browse();
});

after(async () => browser?.close());

/** A page that shows these lines, for as long as `look` takes. */
async function shown(name, text, look) {
  const path = join(folder, `${name}.jsonl`);
  writeFileSync(path, text);
  const program = await serve("view", path, "--no-open");
  const { page, complaints, context } = await open(browser, program.url);
  try {
    await look(page, program);
    if (process.env.PICTURES) await page.screenshot({ path: join(process.env.PICTURES, `damaged_${name}.png`) });
    assert.deepEqual(complaints, []);
  } finally {
    await context.close();
    await program.stop();
  }
}

const notice = (page) => page.locator(".notice");
const trace = (all) => [header, ...all, ""].join("\n");
const moment = (page) => page.getByLabel("Moment", { exact: true });
const isThere = async (page) => {
  await page.getByRole("banner").waitFor();
  await page.getByRole("contentinfo", { name: "Time" }).waitFor();
};

test("a damaged record is named with its line, and the rest is shown", async () => {
  const at = lines.findIndex((line, i) => i > 60 && line.includes('"type": "knowledge"'));
  const scene = lines.findLastIndex((line) => line.includes('"type": "scene"'));
  const all = lines.map((line, i) => (i === at ? line.replace('"author":', '"author"') : i === at + 1 ? line.slice(0, 40) : i === scene ? line.replace("things", "thing ") : line));
  await shown("records", trace(all), async (page) => {
    await loaded(page, lines.length);
    await notice(page).getByText(`Record ${at + 1} (line ${at + 2}) is damaged: it is no JSON`).waitFor();
    await notice(page).getByText(`Record ${at + 2} (line ${at + 3}) is damaged: it ends in the middle`).waitFor();
    await page.getByRole("button", { name: "To the end" }).click();
    await notice(page).getByText(`Record ${scene + 1} (line ${scene + 2}) is damaged`).waitFor();
    await page.locator(".react-flow__node .state").first().waitFor();
    await notice(page).getByRole("button", { name: `Record ${at + 1}` }).click();
    await page.getByLabel("Damaged record").getByText("What stands there").waitFor();
    assert.equal(await moment(page).inputValue(), String(at + 1));
    await page.locator(".react-flow__node .state.active").first().waitFor();
  });
});

test("a trace whose last line was cut says so, and one without records as well", async () => {
  await shown("cut", trace(lines).slice(0, -30), async (page) => {
    await loaded(page, lines.length);
    await notice(page).getByText(`Record ${lines.length} (line ${lines.length + 1}) is damaged: it ends in the middle`).waitFor();
  });
  await shown("empty", `${header}\n`, async (page) => {
    await notice(page).getByText("There are no records").waitFor();
    await isThere(page);
  });
});

test("records of any type and shape never leave a blank page", async () => {
  const types = [...NAMES, "step", "plot", "world", "knowledge", "action", "event", "scene", "rule", "end", "decision", "log", "plan.found",
    "plan.ordered", "plan.broken", "plan.skipped", "plan.none", "plan.replaced", "<script>alert(1)</script>", "\u202eabc", "x".repeat(5000)];
  const bodies = ["", ', "__proto__": {}', `, "microsteps": null, "plot": 7, "hash": "x", "things": {}, "steps": "", "state": [], "text": ${"[".repeat(150)}${"]".repeat(150)}`,
    `, "text": "${"<b>\u202e☂".repeat(20000)}"`];
  const all = types.flatMap((type) => bodies.map((body) => ({ type, body })));
  const odd = all.map(({ type, body }, i) => `{"seq": ${lines.length + i + 1}, "t": 1.0, "type": ${JSON.stringify(type)}, "cause": null${body}}`);
  await shown("odd", trace([...lines, ...odd]), async (page) => {
    await loaded(page, lines.length + odd.length);
    for (let i = 1; i <= odd.length; i += 3) {
      await moment(page).fill(String(lines.length + i));
      await page.locator("body:not([aria-busy=true])").waitFor();
    }
    await isThere(page);
    await page.locator(".react-flow__node .state").first().waitFor();
    await notice(page).getByText("more records are damaged").waitFor();
    await page.locator(".why .record").first().press("Enter");
    await isThere(page);
  });
});

test("names that every object has are names like others", async () => {
  const states = `"${NAMES[0]}": {"on": {"go": [{"to": "${NAMES[1]}"}]}}, "${NAMES[1]}": {"dynamic": ["${NAMES[2]}"], "about": "${NAMES[2]}"}, "${NAMES[2]}": {"states": {"${NAMES[3]}": {}}}`;
  const says = [
    ["world", `"version": 1, "nodes": {${NAMES.map((name) => `"${name}": "${name}"`)}}, "facts": [${NAMES.map((name) => `["${name}", "${name}", "table"]`)}], "values": []`],
    ["plot", `"name": "${NAMES[1]}", "hash": "${NAMES[1]}", "plot": {"plot": "${NAMES[1]}", "states": {${states}}}`],
    ["step", `"variables": {"": {"${NAMES[1]}": 7}}, "microsteps": [{"event": null, "taken": [], "exited": [], "entered": ["${NAMES[1]}"], "bound": [{"state": "", "plot": "${NAMES[1]}", "hash": "${NAMES[1]}"}]}]`],
    ["decision", `"state": "${NAMES[1]}", "chosen": "${NAMES[2]}", "satisfied": false, "arguments": {"${NAMES[1]}": 1}, "version": 1, "candidates": [{"plot": "${NAMES[2]}", "fits": true, "reason": "", "condition": {"text": "(${NAMES[0]})", "truth": true}}]`],
    ["scene", `"things": [${NAMES.map((name, i) => `{"id": "${name}", "shape": "${name}", "x": ${i}, "y": 0, "label": "${name}"}`)}]`],
    ["plan.found", `"plot": "${NAMES[0]}", "steps": [${NAMES.map((name) => `"(${name} ${name})"`)}]`],
    ...NAMES.map((name) => [name, `"${name}": {"${name}": 1}`]),
  ];
  const all = says.map(([type, rest], i) => `{"seq": ${i + 1}, "t": ${i}.0, "type": "${type}", "cause": null, ${rest}}`);
  await shown("names", trace(all), async (page) => {
    await loaded(page, all.length);
    await page.getByRole("button", { name: "To the end" }).click();
    for (const name of NAMES) await page.locator(`.react-flow__node[data-id="${name}"]`).waitFor();
    await clickUntil(page.getByRole("button", { name: /^__proto__, dynamic, active/ }), page.getByRole("row", { name: "?__proto__ 7" }));
    await page.getByRole("tab", { name: "Knowledge" }).click();
    assert.equal(await page.getByLabel("Facts").getByRole("row").count(), NAMES.length);
    await page.getByLabel("Facts").getByRole("button", { name: "__proto__" }).click();
    await page.getByLabel("__proto__ and what it is related to").waitFor();
    assert.equal(await page.locator(".world .thing").count(), NAMES.length);
    assert.equal(await notice(page).count(), 0);
  });
});

test("the address that is left opens the page again, and holds no key", async () => {
  await shown("address", trace(lines), async (page, program) => {
    await loaded(page, lines.length);
    const { origin } = new URL(program.url);
    assert.equal(page.url().replace(/#.*/, ""), `${origin}/`);
    await page.reload();
    await loaded(page, lines.length);
    const second = await page.context().newPage();
    assert.equal((await second.goto(`${origin}/#12`)).status(), 200);
    const other = await browser.newContext();
    const elsewhere = await other.newPage();
    assert.equal((await elsewhere.goto(`${origin}/`)).status(), 403);
    assert.equal((await elsewhere.goto(program.url)).status(), 200);
    await elsewhere.getByRole("banner").waitFor();
    await other.close();
  });
});
