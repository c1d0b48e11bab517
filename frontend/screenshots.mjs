// The pictures that README and docs show: `make screenshots`.
import { mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { browse, goTo, loaded, open, record, ROOT, serve, settled } from "./browser.mjs";

const PICTURES = process.env.PICTURES ?? join(ROOT, "docs", "pictures");
const trace = process.env.TRACE ?? join(mkdtempSync(join(tmpdir(), "dsc-")), "run.jsonl");
if (!process.env.TRACE) await record(trace, "--seed", "7", "--faults", "0.2");
const records = readFileSync(trace, "utf8").trim().split("\n").slice(1).map((line) => JSON.parse(line));
const where = (test, from = 0) => records.find((rec) => rec.seq > from && test(rec)).seq;
const broken = where((rec) => rec.type === "plan.broken");

const program = await serve("view", trace, "--no-open");
const browser = await browse();
try {
  for (const colorScheme of ["light", "dark"]) {
    const { page, complaints } = await open(browser, program.url, { colorScheme });
    await loaded(page, records.length);
    const shoot = (name) => page.screenshot({ path: join(PICTURES, `viewer_${name}${colorScheme === "dark" ? "_dark" : ""}.png`) });
    await goTo(page, where((rec) => rec.type === "rule") - 3);
    await shoot("overview");
    if (colorScheme === "dark" && !process.env.ALL) continue;
    const chosen = where((rec) => rec.type === "decision" && rec.chosen === "pick_up_from_side");
    await goTo(page, chosen);
    await page.getByRole("button", { name: "What", exact: false }).count();
    await page.getByRole("button", { name: "Previous decision" }).click();
    await page.getByRole("button", { name: "Next decision" }).click();
    await settled(page);
    await shoot("decision");
    await goTo(page, broken + 12);
    await page.locator(".one-plan.past .head").first().click();
    await settled(page);
    await shoot("replan");
    await page.getByRole("tab", { name: "Knowledge" }).click();
    await page.getByLabel("Filter or ask").fill("(and (lies-at ?item ?place) (graspable ?item))");
    await page.getByLabel("Answers").waitFor();
    await settled(page);
    await shoot("query");
    await page.getByLabel("Filter or ask").fill("");
    await page.locator(".thing.cup").first().press("Enter");
    await settled(page);
    await shoot("thing");
    if (complaints.length) throw new Error(complaints.join("\n"));
  }
} finally {
  await browser.close();
  await program.stop();
}
