"""The built page: made from today's sources, light, and served as it is, without scripts of its own inside."""

from __future__ import annotations

import gzip
import hashlib
import json
import re
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")
pytest.importorskip("uvicorn", reason="the extra `viewer` is not installed")
httpx = pytest.importorskip("httpx", reason="the extra `viewer` is not installed")

from dsc.viewer.access import PageAddress  # noqa: E402
from dsc.viewer.records import RecordLog  # noqa: E402
from dsc.viewer.server import STATIC, Viewer  # noqa: E402

SOURCE = Path(__file__).parents[3] / "frontend"
MANIFEST = json.loads((STATIC / "manifest.json").read_text())
WORKER = "assets/elk-worker.min.js"
MOST_BYTES = 1_000_000


def hashes(folder: Path, names) -> dict[str, str]:
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in sorted(names)}


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.skipif(not SOURCE.exists(), reason="only the built page is here")
def test_the_page_was_built_from_the_sources_that_are_there():
    known = set(MANIFEST["sources"])
    there = {f"{name}/{path}" for name in ("src", "public") for path in files(SOURCE / name)}
    assert {name for name in known if "/" in name} == there, "make viewer"
    assert hashes(SOURCE, known) == MANIFEST["sources"], "make viewer"


def test_the_build_is_whole():
    assert hashes(STATIC, files(STATIC) - {"manifest.json"}) == MANIFEST["built"], "make viewer"


def test_the_page_is_light():
    weight = sum(len(gzip.compress((STATIC / name).read_bytes())) for name in MANIFEST["built"] if name != WORKER)
    assert weight <= MOST_BYTES


def test_the_page_has_no_scripts_inside_and_asks_nobody_else():
    page = (STATIC / "index.html").read_text()
    assert all(not inside.strip() for inside in re.findall(r"<script[^>]*>(.*?)</script>", page, re.DOTALL))
    assert all(not address.startswith(("http", "//")) for address in re.findall(r'(?:src|href)="([^"]*)"', page))


def test_every_bundled_package_is_named_with_its_version_in_the_licences():
    packages = json.loads((SOURCE / "package.json").read_text())["dependencies"] if SOURCE.exists() else {}
    said = (STATIC / "licenses.md").read_text()
    assert [name for name, version in packages.items() if f"{name} - {version}" not in said] == []


@pytest.mark.parametrize("name", sorted(MANIFEST["built"]))
def test_each_file_is_served_with_its_type(served, name):
    kinds = {".html": "text/html", ".js": "javascript", ".css": "text/css", ".svg": "image/svg", ".md": "text/"}
    answer = served.get(f"/{name}")
    assert (answer.status_code, answer.content) == (200, (STATIC / name).read_bytes())
    assert kinds[Path(name).suffix] in answer.headers["content-type"]


@pytest.fixture(scope="module")
def served():
    viewer = Viewer(RecordLog(), PageAddress.on())
    viewer.start()
    with httpx.Client(base_url=f"http://127.0.0.1:{viewer.port}", params={"token": viewer.token}) as client:
        yield client
    viewer.close()
