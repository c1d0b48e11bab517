// Development in the browser: the author of the plots adds a rule, makes a mistake and mends a plot; the robot goes on.
import assert from "node:assert/strict";
import { mkdtempSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browse, open, serve } from "../browser.mjs";

const ROBOT = `
from pathlib import Path
from dsc import Component, Outcome, SkillCall, load_library, skill
from planning import Bundle


class Moved(Outcome): ...


class Stuck(Outcome): ...


class Arm(Component):
    name = "arm"

    @skill
    async def move(self, call: SkillCall, to: str) -> Moved | Stuck:
        await call.clock.sleep(0.3)
        return Stuck() if to == "corner" else Moved()


BUNDLE = Bundle("arm", plots=tuple(load_library(Path(__file__).parent)), components=lambda: [Arm()], main="main")
`;
const MAIN = "plot: main\nstates:\n  work: {use: part, on: {done: work, stuck: wait}}\n  wait: {after: {seconds: 0.3, to: work}}\n";
const PART = `plot: part
emits: {stuck: }
states:
  reach: {entry: {trigger: arm.move, with: {to: corner}}, on: {moved: end, stuck: lost}}
  end: {final: true}
  lost: {final: true, emit: stuck}
`;
const FREE = "plot: free\nstates:\n  back: {entry: {trigger: arm.move, with: {to: middle}}, on: {moved: end, stuck: end}}\n  end: {final: true}\n";
const RULES = "rules:\n  - {name: free it, on: stuck, do: {use: free, then: retry, limit: 100}}\n  - {on: stuck, do: {then: wait}}\n";

let folder, program, browser, page;
const write = (name, text) => writeFileSync(join(folder, name), text);
const state = (name) => page.locator(`.react-flow__node[data-id$="${name}"] > .state.active`).first();

const goesOn = async () => {
  const seq = Number(await page.getByLabel("Moment", { exact: true }).inputValue());
  await page.waitForFunction((seq) => Number(document.querySelector("input[type=range]").value) > seq + 10, seq);
};

before(async () => {
  folder = mkdtempSync(join(tmpdir(), "dsc-"));
  write("robot.py", ROBOT);
  write("main.yaml", MAIN);
  write("part.yaml", PART);
  program = await serve("run", join(folder, "robot.py"), "--real-time", "--watch", "--view", "--no-open", "--no-wait");
  browser = await browse();
  ({ page } = await open(browser, program.url));
});

after(async () => {
  await browser?.close();
  await program?.stop();
});

test("a rule is added, and the running plot uses its response", { timeout: 60_000 }, async () => {
  await state("wait").waitFor();
  write("free.yaml", FREE);
  write("main.yaml", MAIN.replace(", stuck: wait", "") + RULES);
  await page.getByRole("tab", { name: "Why" }).click();
  await page.getByText("replaced main").first().waitFor();
  await page.keyboard.press("Escape");
  await state("back").waitFor();
});

test("a plot with a mistake is refused with its place, and the robot goes on", { timeout: 60_000 }, async () => {
  write("part.yaml", PART.replace("moved: end", "mved: end"));
  while (!program.errors.some((line) => /part\.yaml:4:\d+: .*'mved'.*'moved'/.test(line))) await page.waitForTimeout(100);
  await goesOn();
});

test("a plot is mended, and the robot goes on in the new state", { timeout: 60_000 }, async () => {
  write("part.yaml", PART.replace("reach: {", "near: {").replace("to: corner", "to: middle"));
  await state("near").waitFor();
  await goesOn();
  assert.equal(await page.getByRole("banner").getByText("live", { exact: true }).count(), 1);
});
