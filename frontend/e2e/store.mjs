// A knowledge store in the browser: its past, what a thing is related to, and what others add while one looks.
import assert from "node:assert/strict";
import { mkdtempSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browse, loaded, open, ROOT, run, serve } from "../browser.mjs";

let store, program, browser, page, complaints;

before(async () => {
  store = join(mkdtempSync(join(tmpdir(), "dsc-")), "kitchen.db");
  run("kb", "new", store, "--domain", join(ROOT, "examples", "kitchen", "domain.pddl"));
  run("kb", "tell", store, "(cup mug)", "(surface table)", "(on mug table)", "--author", "eye");
  run("kb", "tell", store, "(clean mug)", "--author", "dishwasher");
  run("kb", "retract", store, "(on mug table)", "--author", "arm");
  program = await serve("view", store, "--no-open");
  browser = await browse();
  ({ page, complaints } = await open(browser, program.url));
  await loaded(page, 4);
});

after(async () => {
  await browser?.close();
  await program?.stop();
});

const facts = () => page.getByLabel("Facts").getByRole("row").allInnerTexts();

test("the present is shown, and any version before it", async () => {
  await page.getByRole("heading", { name: "Knowledge at version 3" }).waitFor();
  assert.deepEqual((await facts()).map((row) => row.split(/\s/)[0]), ["clean"]);
  await page.getByRole("button", { name: "To the beginning" }).focus();
  await page.keyboard.press("ArrowLeft");
  await page.getByRole("heading", { name: "Knowledge at version 2" }).waitFor();
  assert.deepEqual((await facts()).map((row) => row.split(/\s/)[0]), ["clean", "on"]);
});

test("a thing shows what it is related to, and a question is answered as of the version", async () => {
  await page.getByLabel("Things by type").getByRole("button", { name: "mug" }).click();
  await page.getByLabel("mug and what it is related to").getByRole("button", { name: "table" }).waitFor();
  await page.getByLabel("Filter or ask").fill("(on ?what table)");
  await page.getByLabel("Answers").getByText("1 answers").waitFor();
  await page.getByRole("button", { name: "To the end" }).click();
  await page.getByLabel("Answers").getByText("0 answers").waitFor();
  await page.getByLabel("Filter or ask").fill("");
});

test("what somebody else adds is there", async () => {
  run("kb", "tell", store, "(cup red_cup)", "--author", "eye");
  await page.getByRole("heading", { name: "Knowledge at version 4" }).waitFor();
  await page.getByLabel("Things by type").getByRole("button", { name: "red_cup" }).waitFor();
  assert.deepEqual(complaints, []);
});
