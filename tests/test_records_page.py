"""The page of records: each type that the library records is on it, with no other."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
RECORDED = re.compile(r'(?:trace|self)\.record\(\s*"([a-z._]+)"')
ROW = re.compile(r"^\| `([a-z._]+)` \|", re.MULTILINE)


def test_the_page_has_each_type_of_records_and_no_other() -> None:
    sources = [path for room in ("dsc", "planning") for path in (ROOT / room).rglob("*.py")]
    found = {name for path in sources for name in RECORDED.findall(path.read_text(encoding="utf-8"))}
    page = (ROOT / "docs" / "records.md").read_text(encoding="utf-8")
    assert {"world", "step", "plan.found", "end"} <= found
    assert set(ROW.findall(page)) == found
