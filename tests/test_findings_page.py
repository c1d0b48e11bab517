"""The page of findings: a section for each code, each code in the source, and ignored findings."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

from dsc.codes import CODES

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "findings.md"
_BEGIN = "## Codes\n"
_CODE_IN = {"Finding": 1, "finding": 1, "caught": 2, "_plain": 3, "_evaluable": 3, "_untaken": 4}
"""The position of the code among the arguments of calls that make findings."""


def sections() -> str:
    """Return the text of the page after its heading for codes."""
    return "".join(f"\n### {code}\n\n{sentence}\n" for code, sentence in sorted(CODES.items()))


def used_codes() -> set[str]:
    """Return the codes of all findings in the source, as literals or names of constants."""
    files = [file for room in ("dsc", "planning") for file in (ROOT / room).rglob("*.py")]
    trees = [ast.parse(file.read_text()) for file in files]
    constants = {
        node.targets[0].id: node.value.value
        for tree in trees for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and isinstance(node.value, ast.Constant)
    }  # fmt: skip
    found: set[str] = set()
    for call in (node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call)):
        name = getattr(call.func, "attr", getattr(call.func, "id", ""))
        if name in _CODE_IN and len(call.args) > _CODE_IN[name]:
            code = call.args[_CODE_IN[name]]
            if isinstance(code, ast.Constant) and isinstance(code.value, str):
                found.add(code.value)
            elif isinstance(code, ast.Name) and code.id in constants:
                found.add(str(constants[code.id]))
    return found


def test_each_code_is_in_the_registry_and_each_registered_code_is_used() -> None:
    assert used_codes() == CODES.keys()


def test_the_page_has_a_section_for_each_code() -> None:
    assert PAGE.read_text().partition(_BEGIN)[2] == sections(), "python tests/test_findings_page.py --write"


if __name__ == "__main__" and "--write" in sys.argv:
    PAGE.write_text(PAGE.read_text().partition(_BEGIN)[0] + _BEGIN + sections())
