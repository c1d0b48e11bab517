// A recorded run in the browser: what the page shows is what the records say, at any moment.
import assert from "node:assert/strict";
import { once } from "node:events";
import { mkdtempSync, readFileSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browse, clickUntil, loaded, open, OTHER_NAME, record, serve } from "../browser.mjs";

let program, browser, page, complaints, records;

before(async () => {
  const trace = join(mkdtempSync(join(tmpdir(), "dsc-")), "run.jsonl");
  records = await record(trace);
  program = await serve("view", trace, "--no-open");
  browser = await browse();
  ({ page, complaints } = await open(browser, program.url));
  await loaded(page, records.length);
});

after(async () => {
  await browser?.close();
  await program?.stop();
});

const first = (is, from = 0) => records.find((rec) => rec.seq > from && is(rec));
const moment = () => page.getByLabel("Moment", { exact: true });
const goTo = async (seq) => {
  await moment().fill(String(seq));
  await page.locator("body:not([aria-busy=true])").waitFor(); // panes that take turns have all had theirs
};
const shown = async () => Number(await moment().inputValue());
const active = (path) => page.locator(`.react-flow__node[data-id="${path}"] > .state.active`);

/** What a button of that name saves. */
async function saved(name) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name, exact: true }).click()]);
  return readFileSync(await download.path(), "utf8");
}

/** The path of a plan's step as the page tells it: by what the step does. */
function inWords(path, seq) {
  const { steps } = records.findLast((rec) => rec.seq < seq && rec.type === "plan.ordered");
  return path.replace(/step_(\d+)$/, (_, number) => `${number} ${steps[number - 1].slice(1, -1)}`);
}

/** The configuration after a record, worked out here from the steps alone. */
function configuration(seq) {
  const paths = new Set();
  for (const rec of records.slice(0, seq)) {
    for (const micro of rec.type === "step" ? rec.microsteps : []) {
      micro.exited.forEach((path) => paths.delete(path));
      micro.entered.forEach((path) => paths.add(path));
    }
  }
  return paths;
}

test("a recorded run opens at its end, and says how it ended", async () => {
  assert.equal(await shown(), records.length);
  const { reason } = records.at(-1);
  await page.getByRole("banner").getByText(`finished: ${reason}`).waitFor();
  await goTo(1);
  await page.getByRole("banner").getByRole("button", { name: "finished: " }).click();
  assert.equal(await shown(), records.length);
});

test("the chart shows the change of the active state, and the transition taken in the trail", async () => {
  const step = first((rec) => rec.type === "step" && rec.microsteps.some((micro) => micro.entered.includes("clear/execute/step_2")));
  await goTo(step.seq - 1);
  await active("clear/execute/step_1").waitFor();
  assert.equal(await active("clear/execute/step_2").count(), 0);
  await goTo(step.seq);
  await active("clear/execute/step_2").waitFor();
  assert.equal(await active("clear/execute/step_1").count(), 0);
  const taken = page.locator('[data-way="clear/execute/step_1>step_2"].taken');
  await taken.waitFor({ state: "attached" });
  assert.equal(await taken.evaluate((way) => way.style.getPropertyValue("--age")), "0");
});

test("all states that are marked as active are, and the outermost one is marked", async () => {
  for (const rec of records.filter((one) => one.type === "step").filter((_, i) => i % 25 === 3)) {
    await goTo(rec.seq);
    const paths = configuration(rec.seq);
    await active([...paths][0]).waitFor();
    const marked = await page.locator(".react-flow__node:has(> .state.active)").evaluateAll((nodes) => nodes.map((node) => node.dataset.id));
    for (const path of marked) assert.ok(paths.has(path), `${path} after record ${rec.seq}`);
  }
});

test("a decision record shows each candidate and the leaf that decided", async () => {
  const decision = first((rec) => rec.type === "decision" && rec.chosen === "pick_up_from_side");
  await goTo(decision.seq - 1);
  await page.getByRole("button", { name: "Next decision" }).click();
  const why = page.getByLabel("Decision", { exact: true });
  await why.getByLabel("pick_up_from_side: chosen").waitFor();
  const rejected = why.getByLabel("pick_up_from_above: rejected");
  assert.match(await rejected.locator(".leaf.false.decides").innerText(), /\(= \(failures \w+\) 0\)/);
  await page.keyboard.press("Escape");
});

test("a state tells its parameters, and its decision", async () => {
  const decision = first((rec) => rec.type === "decision" && rec.chosen === "stack");
  await goTo(decision.seq);
  await page.getByLabel("Decision", { exact: true }).getByRole("button", { name: inWords(decision.state, decision.seq) }).click();
  const state = page.getByLabel("State", { exact: true });
  await state.getByRole("row", { name: `?item ${decision.arguments.item}` }).first().waitFor();
  await state.getByLabel("stack: chosen").waitFor();
  await page.keyboard.press("Escape");
});

test("a click in the chart selects a state; it is collapsed, opened and zoomed into", async () => {
  await goTo(first((rec) => rec.type === "step" && rec.microsteps.some((micro) => micro.entered.includes("look_at_table/look"))).seq);
  const node = (path) => page.locator(`.react-flow__node[data-id="${path}"]`);
  await node("look_at_table/look").waitFor();
  const button = (name) => page.getByRole("button", { name });
  await clickUntil(button(/^look_at_table, /), page.getByLabel("State", { exact: true }).getByText("Inside: search"));
  await clickUntil(button("Collapse look_at_table"), node("look_at_table/look"), { state: "detached" });
  await clickUntil(button("Expand look_at_table"), node("look_at_table/look"));
  await clickUntil(button("Zoom into look_at_table"), node("work"), { state: "detached" });
  await page.getByRole("button", { name: "Chart", exact: true }).click();
  await node("work").waitFor();
  await page.keyboard.press("Escape");
});

test("the chart of a moment is saved as an SVG, with all that is open in it", async () => {
  const moment = first((rec) => rec.type === "step" && rec.microsteps.some((micro) => micro.entered.includes("clear/execute/step_2")));
  await goTo(moment.seq);
  await active("clear/execute/step_2").waitFor();
  const picture = await saved("SVG");
  assert.match(picture, new RegExp(`after record ${moment.seq}`));
  const drawn = await page.evaluate((text) => {
    const made = new DOMParser().parseFromString(text, "image/svg+xml");
    return { wrong: made.querySelector("parsererror")?.textContent, bold: [...made.querySelectorAll("text.bold")].map((one) => one.textContent), taken: made.querySelectorAll('[marker-end="url(#taken)"]').length };
  }, picture);
  assert.equal(drawn.wrong, undefined);
  assert.ok(drawn.bold.some((text) => text.startsWith("◆ 2 ")));
  assert.ok(drawn.taken > 0);
});

test("world, plan and chart of a moment are saved as one SVG, in light colours also from a dark page", async () => {
  const moment = first((rec) => rec.type === "step" && rec.microsteps.some((micro) => micro.entered.includes("clear/execute/step_2")));
  await goTo(moment.seq);
  await active("clear/execute/step_2").waitFor();
  await page.emulateMedia({ colorScheme: "dark" });
  const picture = await saved("SVG of all");
  await page.emulateMedia({ colorScheme: "light" });
  const [plan] = records.filter((rec) => rec.type === "plan.ordered" && rec.seq < moment.seq).slice(-1);
  const drawn = await page.evaluate((text) => {
    const made = new DOMParser().parseFromString(text, "image/svg+xml");
    const robot = made.querySelector("[aria-label=robot] circle");
    return {
      wrong: made.querySelector("parsererror")?.textContent,
      texts: [...made.querySelectorAll("text")].map((one) => one.textContent),
      robot: robot?.getAttribute("style"),
      classes: [...made.querySelectorAll("svg svg [class]")].length,
    };
  }, picture);
  assert.equal(drawn.wrong, undefined);
  plan.steps.forEach((step, i) => assert.ok(drawn.texts.includes(`${i + 1} ${step.slice(1, -1)}`), step));
  assert.ok(drawn.texts.some((text) => text.startsWith("◆ 2 ")));
  assert.ok(drawn.texts.includes("sink"));
  assert.match(drawn.robot, /fill:\s*rgb\(0, 114, 178\)/);
  assert.equal(drawn.classes, 0);
});

test("while the robot plans, the page says so, with the goal, and says when the plan is there", async () => {
  const asked = first((rec) => rec.type === "plan.asked");
  const found = first((rec) => rec.type === "plan.found", asked.seq);
  const plan = page.getByLabel("Plan", { exact: true });
  await goTo(asked.seq);
  await page.getByRole("banner").getByText("planning …").waitFor();
  await plan.getByText("planning …").waitFor();
  assert.ok((await plan.innerText()).includes(asked.goal));
  await goTo(found.seq);
  await plan.getByText("plan found").waitFor();
  assert.equal(await page.getByText("planning …", { exact: true }).count(), 0);
});

test("the plan is there before and after a replan, with what broke it and who did", async () => {
  const broken = first((rec) => rec.type === "plan.broken");
  const old = records.findLast((rec) => rec.seq < broken.seq && rec.type === "plan.ordered");
  const next = first((rec) => rec.type === "plan.ordered", broken.seq);
  await goTo(broken.seq - 1);
  await page.getByLabel(old.plot, { exact: false }).first().waitFor();
  assert.equal(await page.getByLabel(`${old.plot} given up`).count(), 0);
  await goTo(first((rec) => rec.type === "step", next.seq).seq);
  await page.getByLabel(`${old.plot} given up`).locator(".head").click();
  assert.equal(await page.locator(".one-plan").first().locator("ol li").count(), next.steps.length);
  assert.match(await page.locator(".one-plan").first().innerText(), new RegExp(next.plot));
  const why = page.getByLabel("Broken plan");
  assert.ok((await why.innerText()).includes(broken.link.fact));
  await why.getByRole("button", { name: /knowledge/ }).waitFor();
  await page.keyboard.press("Escape");
});

test("a step of the plan tells what it provides to whom, and what it relies on", async () => {
  const plan = first((rec) => rec.type === "plan.ordered");
  const [provider, fact, user] = plan.links.find(([from, , to]) => from > 0 && to <= plan.steps.length);
  await goTo(first((rec) => rec.type === "step", plan.seq).seq);
  await page.getByLabel(`${provider} ${plan.steps[provider - 1]}:`).click();
  const why = page.getByLabel("Step of the plan");
  const provided = why.locator("h3:text('Provides') + ul li").filter({ hasText: fact });
  await page.getByLabel(`${user} ${plan.steps[user - 1]}:`).and(page.getByLabel("relies on the step selected")).waitFor();
  await provided.getByRole("button", { name: `${user} ${plan.steps[user - 1]}` }).click();
  await why.locator("h3:text('Relies on') + ul li").filter({ hasText: fact }).getByText(`${provider} ${plan.steps[provider - 1]}`).waitFor();
  await page.keyboard.press("Escape");
});

test("a step of the plan tells what it changed", async () => {
  const step = first((rec) => rec.type === "step" && rec.microsteps.some((micro) => micro.entered.includes("clear/execute/step_2")));
  await goTo(step.seq);
  await page.getByLabel(/^1 \(pick-up .*: done$/).click();
  await page.getByLabel("Step of the plan").getByText(/\+ \(holding/).waitFor();
  await page.keyboard.press("Escape");
});

test("the scrubber goes back and shows the past as it was", async () => {
  const all = async () => (await page.locator(".world, .plan, .clock").allInnerTexts()).join("\n");
  const places = async () => page.locator(".thing").evaluateAll((things) => things.map((thing) => thing.ariaLabel + thing.style.transform));
  await goTo(200);
  const [past, there] = [await all(), await places()];
  await goTo(records.length);
  assert.notEqual(await all(), past);
  assert.notDeepEqual(await places(), there);
  await goTo(200);
  assert.equal(await all(), past);
  assert.deepEqual(await places(), there);
});

test("a question is answered as of the moment", async () => {
  await page.getByRole("tab", { name: "Knowledge" }).click();
  await page.getByLabel("Filter or ask").fill("(holding ?what)");
  const picked = first((rec) => rec.type === "knowledge" && rec.added?.some(([name]) => name === "holding"));
  await goTo(picked.seq);
  await page.getByLabel("Answers").getByText("1 answers").waitFor();
  await page.getByLabel("Answers").getByText(picked.added.find(([name]) => name === "holding")[1], { exact: true }).waitFor();
  await goTo(picked.seq - 1);
  await page.getByLabel("Answers").getByText("0 answers").waitFor();
  assert.deepEqual(complaints, []);
  await page.getByLabel("Filter or ask").fill("(holdin ?what)");
  await page.getByRole("alert").getByText("holding").waitFor();
  complaints.length = 0; // a refused question is a 400, which the browser reports
  await page.getByLabel("Filter or ask").fill("");
  await page.getByRole("tab", { name: "Why" }).click();
});

test("everything is moved by the keyboard", async () => {
  await page.getByRole("tab", { name: "Why" }).focus();
  await page.keyboard.press("Home");
  assert.equal(await shown(), 0);
  await page.keyboard.press("]");
  assert.equal(await shown(), first((rec) => ["rule", "plan.broken", "plan.none"].includes(rec.type)).seq);
  await page.keyboard.press("ArrowRight");
  const step = await shown();
  assert.equal(records[step - 1].type, "step");
  await page.keyboard.press("ArrowLeft");
  assert.ok((await shown()) < step);
  await page.keyboard.press("End");
  assert.equal(await shown(), records.length);
  await page.keyboard.press("Home");
  await page.getByLabel("Moment", { exact: true }).focus();
  await page.keyboard.press(" ");
  await page.getByRole("button", { name: "Pause" }).waitFor();
  await page.waitForFunction(() => Number(document.querySelector("input[type=range]").value) > 20);
  await page.keyboard.press(" ");
  await page.getByRole("button", { name: "Play" }).waitFor();
});

test("the list of keys is opened and closed by the keyboard, and moves nothing meanwhile", async () => {
  await page.keyboard.press("Home");
  const list = page.getByRole("dialog", { name: "Keys and signs" });
  await page.getByRole("button", { name: "Keys and signs" }).press("Enter");
  await list.waitFor();
  await page.keyboard.press("End");
  await page.keyboard.press("Escape");
  await list.waitFor({ state: "hidden" });
  assert.equal(await shown(), 0);
});

test("every control has a name, and the page asks nobody else for anything", async () => {
  const nameless = await page.locator("button, input, select, [role=button]").evaluateAll((all) =>
    all.filter((one) => !(one.ariaLabel || one.title || one.textContent.trim() || one.labels?.length)).map((one) => one.outerHTML));
  assert.deepEqual(nameless, []);
  const asked = await page.evaluate(() => performance.getEntriesByType("resource").map((entry) => new URL(entry.name).host));
  assert.deepEqual([...new Set(asked)], [new URL(program.url).host]);
  assert.deepEqual(complaints, []);
});

test("a wrong token is refused, and so are another Host and another Origin, also for a socket", async () => {
  const other = await browser.newContext();
  const stranger = await other.newPage();
  assert.equal((await stranger.goto(program.url.replace(/token=.*/, "token=wrong"))).status(), 403);
  const { host, port } = new URL(program.url);
  assert.equal((await stranger.goto(program.url.replace(host, `${OTHER_NAME}:${port}`))).status(), 403);
  const elsewhere = createServer((_, answer) => answer.end("<!doctype html>")).listen(0, "127.0.0.1");
  await once(elsewhere, "listening");
  await stranger.goto(`http://127.0.0.1:${elsewhere.address().port}/`);
  const token = new URL(program.url).search;
  const opened = await stranger.evaluate((url) => new Promise((done) => {
    const socket = new WebSocket(url);
    socket.onopen = () => done(true);
    socket.onclose = () => done(false);
  }), `ws://${host}/socket${token}`);
  const asked = await stranger.evaluate((url) => fetch(url, { method: "POST", body: "{}" }).then(() => true, () => false), `http://${host}/query${token}`);
  elsewhere.close();
  await other.close();
  assert.deepEqual([opened, asked], [false, false]);
});
