// Writes which sources the built page was made from: sha256 of each, so that a test without Node can tell whether the
// build is that of today's sources. `dsc/viewer/static` is then read by nobody else than the server.
import { createHash } from "node:crypto";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join, relative } from "node:path";
import { fileURLToPath } from "node:url";

const here = fileURLToPath(new URL(".", import.meta.url));
const built = join(here, "..", "dsc", "viewer", "static");
const FOLDERS = ["src", "public"];
const FILES = ["index.html", "package.json", "tsconfig.json", "vite.config.ts"];

const hash = (path) => createHash("sha256").update(readFileSync(path)).digest("hex");
const inside = (folder) =>
  readdirSync(folder, { withFileTypes: true, recursive: true })
    .filter((entry) => entry.isFile())
    .map((entry) => join(entry.parentPath, entry.name));
const hashes = (paths, base) =>
  Object.fromEntries(paths.map((path) => [relative(base, path).replaceAll("\\", "/"), hash(path)]).sort());

const manifest = {
  sources: hashes([...FILES.map((name) => join(here, name)), ...FOLDERS.flatMap((name) => inside(join(here, name)))], here),
  built: hashes(inside(built).filter((path) => !path.endsWith("manifest.json")), built),
};
writeFileSync(join(built, "manifest.json"), `${JSON.stringify(manifest, null, 1)}\n`);
