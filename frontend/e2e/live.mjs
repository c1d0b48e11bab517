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

// The run does not wait for the page: which state is active when the page is drawn depends on the machine.
const ACTIVE = ".react-flow__node[data-id] > .state.active";
const names = (found) => found.map((node) => node.parentElement.dataset.id).sort().join();
const slider = () => page.getByLabel("Moment", { exact: true });
const follows = () => page.waitForFunction(() => {
  const made = document.querySelector("input[type=range]");
  return Number(made.max) > 0 && made.value === made.max;
});

test("the page follows the run, and shows the change of the active state as it happens", { timeout: 120_000 }, async () => {
  await page.getByRole("banner").getByText("live", { exact: true }).waitFor();
  await page.locator(ACTIVE).first().waitFor();
  const first = await page.$$eval(ACTIVE, names);
  const before = Number(await slider().inputValue());
  await page.waitForFunction((seq) => Number(document.querySelector("input[type=range]").value) > seq, before, { timeout: 40_000 });
  while ((await page.$$eval(ACTIVE, names)) === first) await page.waitForTimeout(100); // the test's limit ends it
  await follows();
});

test("a held run stands still and says so, and goes on", { timeout: 60_000 }, async () => {
  await page.getByRole("tab", { name: "Control" }).click();
  await page.getByRole("button", { name: "Hold it" }).click();
  await page.getByRole("banner").getByText("stands still: on request").waitFor({ timeout: 40_000 });
  await page.getByRole("button", { name: "Go on" }).click();
  await page.getByRole("banner").getByText("stands still").waitFor({ state: "detached" });
});

test("a fact that is handed in is known, and stops the run at a breakpoint on it; taken away, the run goes on", { timeout: 60_000 }, async () => {
  await page.getByLabel("Add: what").selectOption("condition");
  await page.getByLabel("Add: which").fill("(robot-at operator)");
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await page.getByLabel("Send: what").selectOption("tell");
  await page.getByLabel("Send: which").fill("(robot-at operator)");
  await page.getByRole("button", { name: "Send" }).click();
  await page.getByRole("banner").getByText("stands still: condition (robot-at operator)").waitFor({ timeout: 40_000 });
  await page.getByRole("tab", { name: "Knowledge" }).click();
  await page.getByLabel("Filter or ask").fill("(robot-at operator)");
  await page.getByLabel("Answers").getByText("true", { exact: true }).waitFor();
  await page.getByLabel("Filter or ask").fill("");
  await page.getByRole("tab", { name: "Control" }).click();
  await page.getByLabel("Send: what").selectOption("retract");
  await page.getByLabel("Send: which").fill("(robot-at operator)");
  await page.getByRole("button", { name: "Send" }).click();
  await page.getByRole("button", { name: "Remove condition (robot-at operator)" }).click();
  await page.getByRole("button", { name: /^Remove/ }).waitFor({ state: "detached" });
  await page.getByRole("button", { name: "Go on" }).click();
  await page.getByRole("banner").getByText("stands still").waitFor({ state: "detached" });
});

test("an event that no plot receives is refused, and one that is handed in is one of the run", { timeout: 60_000 }, async () => {
  await page.getByLabel("Send: what").selectOption("event");
  await page.getByLabel("Send: which").fill("restrat");
  await page.getByRole("button", { name: "Send" }).click();
  await page.getByRole("alert").getByText("no plot receives the event 'restrat'; did you mean 'restart'?").waitFor();
  await page.getByLabel("Send: which").fill("restart");
  await page.getByRole("button", { name: "Send" }).click();
  await page.getByRole("tab", { name: "Why" }).click();
  await page.getByText("restart from").first().click({ timeout: 40_000 });
  await page.keyboard.press("Escape");
  await page.keyboard.press("End");
});

test("who goes back is no longer taken along, until he goes to the end", { timeout: 60_000 }, async () => {
  await slider().fill("3");
  await page.waitForFunction(() => document.querySelector("input[type=range]").max > 12, null, { timeout: 40_000 });
  assert.equal(await slider().inputValue(), "3");
  await page.getByRole("button", { name: "To the end" }).click();
  await follows();
  await page.getByRole("button", { name: "Pause" }).waitFor();
});
