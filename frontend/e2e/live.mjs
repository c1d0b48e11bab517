// A run while it goes on: the page follows it, holds it where that was allowed, and lets it go on.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browse, open, serve } from "../browser.mjs";

let program, browser, page;

before(async () => {
  program = await serve("run", "clean-up-table", "--real-time", "--view", "--no-open", "--no-wait", "--allow-control", "--seed", "1");
  browser = await browse();
  ({ page } = await open(browser, program.url));
});

after(async () => {
  await browser?.close();
  await program?.stop();
});

const slider = () => page.getByLabel("Moment", { exact: true });
const follows = () => page.waitForFunction(() => {
  const made = document.querySelector("input[type=range]");
  return Number(made.max) > 0 && made.value === made.max;
});

test("the page follows the run, and shows the change of the active state as it happens", { timeout: 60_000 }, async () => {
  await page.getByRole("banner").getByText("live", { exact: true }).waitFor();
  await page.locator('.react-flow__node[data-id="look_at_table"] > .state.active').waitFor();
  const before = Number(await slider().inputValue());
  await page.waitForFunction((seq) => Number(document.querySelector("input[type=range]").value) > seq, before, { timeout: 40_000 });
  await follows();
});

test("a held run stands still and says so, and goes on", { timeout: 60_000 }, async () => {
  await page.getByRole("tab", { name: "Control" }).click();
  await page.getByRole("button", { name: "Hold it" }).click();
  await page.getByRole("banner").getByText("stands still: asked to").waitFor({ timeout: 40_000 });
  await page.getByRole("button", { name: "Go on" }).click();
  await page.getByRole("banner").getByText("stands still").waitFor({ state: "detached" });
});

test("a breakpoint is listed and taken away", async () => {
  await page.getByLabel("Add: what").selectOption("plan_step");
  await page.getByLabel("Add: which").fill("(drive table sink)");
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await page.getByRole("button", { name: "Remove plan step (drive table sink)" }).click();
  await page.getByRole("button", { name: /^Remove/ }).waitFor({ state: "detached" });
});

test("who goes back is no longer taken along, until he goes to the end", { timeout: 60_000 }, async () => {
  await slider().fill("3");
  await page.waitForFunction(() => document.querySelector("input[type=range]").max > 12, null, { timeout: 40_000 });
  assert.equal(await slider().inputValue(), "3");
  await page.getByRole("button", { name: "To the end" }).click();
  await follows();
  await page.getByRole("button", { name: "Pause" }).waitFor();
});
