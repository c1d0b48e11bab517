// Components in the browser: wires, waits, and the values over time that a monitoring profile has recorded with the run.
import assert from "node:assert/strict";
import { mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browse, loaded, open, ROOT, run, serve } from "../browser.mjs";

let program, browser, page, records;

before(async () => {
  const trace = join(mkdtempSync(join(tmpdir(), "dsc-")), "run.jsonl");
  const example = join(ROOT, "examples", "second_camera");
  run("run", `${example}.py`, "--monitor", `${example}.yaml`, "--trace", trace, "--json");
  records = readFileSync(trace, "utf8").trim().split("\n").slice(1).map((line) => JSON.parse(line));
  program = await serve("view", trace, "--no-open");
  browser = await browse();
  ({ page } = await open(browser, program.url));
  await loaded(page, records.length);
  await page.getByRole("tab", { name: "Components" }).click();
});

after(async () => {
  await browser?.close();
  await program?.stop();
});

const goTo = async (seq) => {
  await page.getByLabel("Moment", { exact: true }).fill(String(seq));
  await page.locator("body:not([aria-busy=true])").waitFor();
};
const component = (name) => page.getByLabel(name, { exact: true });
const seen = (seq, name, entry) => records.filter((rec) => rec.seq <= seq && rec.type === "observation" && rec.component === name && rec.entry === entry);

test("a component has its wires, and its skill while it works", async () => {
  const start = records.find((rec) => rec.type === "action" && rec.action === "start" && rec.skill === "camera.recognise");
  await goTo(start.seq);
  await page.getByLabel("Wires of camera").getByText("← head.picture").waitFor();
  await component("camera").getByRole("button", { name: "recognise" }).waitFor();
  await goTo(records.length);
  await component("camera").getByRole("button", { name: "recognise" }).waitFor({ state: "detached" });
});

test("the values are those up to the moment, with a line over time", async () => {
  const half = records.findLast((rec) => rec.type === "observation" && rec.seq < records.length / 2).seq;
  for (const seq of [half, records.length]) {
    await goTo(seq);
    const values = seen(seq, "head", "program.processor_s");
    const row = page.getByLabel("Values of head").getByRole("row", { name: /^program\.processor_s/ });
    await row.getByText(String(values.at(-1).value), { exact: true }).waitFor();
    const path = await row.getByRole("img").locator("path").getAttribute("d");
    assert.equal(path.split("V").length, values.length, path);
  }
});

test("a component that is not active has no values of its stream, and a life of its own", async () => {
  await page.getByLabel("Values of wrist").getByText("init").waitFor();
  assert.equal(await page.getByLabel("Values of wrist").getByText("picture").count(), 0);
});
