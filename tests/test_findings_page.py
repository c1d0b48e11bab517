"""The page of findings: a section for each code, each code in the source, and ignored findings."""

from __future__ import annotations

import sys
from pathlib import Path

from dsc.codes import CODES

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "findings.md"
_BEGIN = "## Codes\n"


def sections() -> str:
    """Return the text of the page after its heading for codes."""
    return "".join(f"\n### {code}\n\n{sentence}\n" for code, sentence in sorted(CODES.items()))


def test_each_code_is_in_the_registry_and_each_registered_code_is_used() -> None:
    from finding_codes import codes_in  # the script of this file runs without `support`

    files = [file for room in ("dsc", "planning") for file in (ROOT / room).rglob("*.py")]
    assert codes_in(files) == CODES.keys()


def test_the_page_has_a_section_for_each_code() -> None:
    assert PAGE.read_text().partition(_BEGIN)[2] == sections(), "python tests/test_findings_page.py --write"


if __name__ == "__main__" and "--write" in sys.argv:
    PAGE.write_text(PAGE.read_text().partition(_BEGIN)[0] + _BEGIN + sections())
