// A kept run that was suspended, in the browser: it is over until a program resumes it.
import assert from "node:assert/strict";
import { mkdtempSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { browse, open, serve } from "../browser.mjs";

const PAGE = ["--view", "--no-open"];

test("a suspended run opens at its end and says so; once it is resumed, it is live and followed", { timeout: 120_000 }, async () => {
  const store = join(mkdtempSync(join(tmpdir(), "dsc-")), "run.kb");
  const first = await serve("run", "clean-up-table", "--seed", "1", "--store", store, "--real-time", ...PAGE);
  await new Promise((done) => setTimeout(done, 2000));
  await first.stop();
  const program = await serve("view", store, "--no-open");
  const browser = await browse();
  let second;
  try {
    const { page, complaints } = await open(browser, program.url);
    const banner = page.getByRole("banner");
    await banner.getByText("cut off: killed or suspended before its end").waitFor();
    const slider = page.getByLabel("Moment", { exact: true });
    const last = Number(await slider.inputValue());
    assert.ok(last > 0);
    assert.equal(await slider.getAttribute("max"), String(last));
    second = await serve("run", "--resume", store, ...PAGE);
    await banner.getByText("live", { exact: true }).waitFor();
    await page.waitForFunction((seq) => Number(document.querySelector("input[type=range]").value) > seq, last, { timeout: 40_000 });
    assert.deepEqual(complaints, []);
  } finally {
    await browser.close();
    await program.stop();
    await second?.stop();
  }
});
