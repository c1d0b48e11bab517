// The pictures of the page that the docs show: `make screenshots`. Whole pages where it is about the whole, else a pane.
import { mkdtempSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { browse, goTo, loaded, open, record, ROOT, run, serve, settled } from "./browser.mjs";

const PICTURES = process.env.PICTURES ?? join(ROOT, "docs", "pictures");
const trace = join(mkdtempSync(join(tmpdir(), "dsc-")), "run.jsonl");
const records = await record(trace);
const where = (is, from = 0) => records.find((rec) => rec.seq > from && is(rec)).seq;
const broken = where((rec) => rec.type === "plan.broken");
const replanned = where((rec) => rec.type === "step", where((rec) => rec.type === "plan.ordered", broken));

const program = await serve("view", trace, "--no-open");
const browser = await browse();

async function looked(colorScheme, shoot) {
  const { page, context } = await open(browser, program.url, { colorScheme });
  await loaded(page, records.length);
  await shoot(page, (name, pane) => (pane ? page.locator(pane) : page).screenshot({ path: join(PICTURES, `viewer_${name}.png`) }));
  await context.close();
}

try {
  await looked("light", async (page, shoot) => {
    await goTo(page, where((rec) => rec.type === "step" && rec.microsteps.some((micro) => micro.entered.includes("clear/execute/step_5")), replanned));
    await page.getByLabel("Moment", { exact: true }).blur();
    await shoot("plan");
    const step = page.locator(".one-plan").first().getByRole("button", { name: /\(throw-away / }).last();
    await step.press("Enter");
    await settled(page);
    await shoot("links");
    await page.keyboard.press("Escape");
    await goTo(page, where((rec) => rec.type === "decision" && rec.chosen === "pick_up_from_side") - 1);
    await page.getByRole("button", { name: "Next decision" }).click();
    await settled(page);
    await shoot("decision", ".side");
    await goTo(page, replanned);
    await page.locator(".one-plan.past .head").first().press("Enter");
    await settled(page);
    await shoot("replan", ".side");
    await goTo(page, where((rec) => rec.type === "step", records.findLast((rec) => rec.type === "plan.ordered").seq));
    await page.keyboard.press("Escape");
    await page.getByLabel("Moment", { exact: true }).blur();
    await shoot("plans", ".pane.plan");
    await goTo(page, replanned);
    await page.getByRole("tab", { name: "Knowledge" }).click();
    await page.getByLabel("Filter or ask").fill("(and (lies-at ?i table) (fits ?i cup2))");
    await page.getByLabel("Answers").waitFor();
    await shoot("query", ".side");
    await page.getByLabel("Filter or ask").fill("");
    await page.locator(".thing.cup").first().press("Enter");
    await settled(page);
    await shoot("thing", ".side");
  });
  await looked("dark", async (page, shoot) => {
    await goTo(page, where((rec) => rec.type === "step" && rec.microsteps.some((micro) => micro.entered.includes("look_at_table/look"))));
    await page.getByRole("button", { name: /^look_at_table, / }).click();
    await settled(page);
    await shoot("designed");
  });
  await storeLooked();
  await componentsLooked();
} finally {
  await browser.close();
  await program.stop();
}

/** A run with two cameras, which a monitoring profile observes. */
async function componentsLooked() {
  const [observed, example] = [join(mkdtempSync(join(tmpdir(), "dsc-")), "observed.jsonl"), join(ROOT, "examples", "second_camera")];
  run("run", `${example}.py`, "--monitor", `${example}.yaml`, "--trace", observed, "--json");
  const other = await serve("view", observed, "--no-open");
  const { page, context } = await open(browser, other.url);
  await loaded(page, 200);
  await goTo(page, 200);
  await page.getByRole("tab", { name: "Components" }).click();
  await page.locator(".side").screenshot({ path: join(PICTURES, "viewer_components.png") });
  await context.close();
  await other.stop();
}

/** A store into which the run's knowledge went, change by change. */
async function storeLooked() {
  const store = join(mkdtempSync(join(tmpdir(), "dsc-")), "kitchen.db");
  run("kb", "new", store, "--domain", join(ROOT, "examples", "kitchen", "domain.pddl"));
  run("kb", "import", store, join(ROOT, "examples", "kitchen", "problem.pddl"));
  run("kb", "retract", store, "(on mug table)", "--author", "arm");
  run("kb", "tell", store, "(on mug sink)", "(on muesli table)", "--author", "arm");
  const other = await serve("view", store, "--no-open");
  const { page, context } = await open(browser, other.url);
  await page.getByLabel("Things by type").getByRole("button", { name: "sink" }).click();
  await page.mouse.move(0, 0);
  await page.screenshot({ path: join(PICTURES, "viewer_store.png") });
  await context.close();
  await other.stop();
}
