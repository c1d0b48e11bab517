// Data by reference in the browser: a record shows the picture and the scan that it names.
import assert from "node:assert/strict";
import { mkdtempSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browse, loaded, open, run, serve } from "../browser.mjs";

const ROBOT = `
import math
import struct
import zlib
from pathlib import Path
from dsc import Component, DataFolder, Outcome, SkillCall, load_library, skill
from planning import Bundle

HERE = Path(__file__).parent


def png(width, height):
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    rows = b"".join(b"\\0" + bytes(v for x in range(width) for v in (x % 256, y % 256, 128)) for y in range(height))
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\\x89PNG\\r\\n\\x1a\\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class Seen(Outcome):
    picture: str
    scan: str


class Camera(Component):
    name = "camera"
    data = DataFolder(HERE / "data")

    @skill
    async def look(self, call: SkillCall) -> Seen:
        scan = [2 + math.sin(n / 40) for n in range(720)]
        return Seen(picture=self.data.keep(png(200, 120), ".png"), scan=self.data.keep(scan))


BUNDLE = Bundle("camera", plots=tuple(load_library(HERE)), components=lambda: [Camera()], main="main")
`;
const MAIN = "plot: main\nstates:\n  look: {entry: {trigger: camera.look}, on: {seen: end}}\n  end: {final: true}\n";

let folder, browser;

before(async () => {
  folder = mkdtempSync(join(tmpdir(), "dsc-"));
  writeFileSync(join(folder, "robot.py"), ROBOT);
  writeFileSync(join(folder, "main.yaml"), MAIN);
  run("run", join(folder, "robot.py"), "--trace", join(folder, "run.jsonl"), "--json");
  browser = await browse();
});

after(() => browser?.close());

async function event(test, ...options) {
  const program = await serve("view", join(folder, "run.jsonl"), "--no-open", ...options);
  test.after(() => program.stop());
  const { page, complaints } = await open(browser, program.url);
  await loaded(page, 5);
  await page.getByRole("tab", { name: "Why" }).click();
  await page.getByRole("button", { name: /seen from/ }).first().click();
  return { page, complaints };
}

test("a record shows its picture and its scan", { timeout: 60_000 }, async (test) => {
  const { page, complaints } = await event(test, "--data", join(folder, "data"));
  const picture = page.locator("img.datum").first();
  await picture.waitFor();
  await page.waitForFunction(() => document.querySelector("img.datum").naturalWidth === 200);
  await page.getByRole("img", { name: /720 numbers/ }).first().waitFor();
  await page.getByText("720 numbers, 1.00 to 3.00").first().waitFor();
  if (process.env.SHOT) await page.screenshot({ path: process.env.SHOT });
  assert.deepEqual(complaints, []);
});

test("without the folder, the reference is shown as text", { timeout: 60_000 }, async (test) => {
  const { page } = await event(test);
  await page.getByText(/not in the folder of data/).first().waitFor();
});
