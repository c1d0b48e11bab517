"""The codes of findings that source files contain, as literals or as names of constants."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path

_CODE_IN = {"Finding": 1, "finding": 1, "caught": 2, "finding_at": 3, "_plain": 3, "_evaluable": 3, "_untaken": 4}
"""The position of the code among the arguments of calls that make findings."""


def codes_in(files: Iterable[Path]) -> set[str]:
    """Return the codes of all findings that these files make."""
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    constants = {
        node.targets[0].id: node.value.value
        for node in nodes
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and isinstance(node.value, ast.Constant)
    }
    found: set[str] = set()
    for call in (node for node in nodes if isinstance(node, ast.Call)):
        name = getattr(call.func, "attr", getattr(call.func, "id", ""))
        if name in _CODE_IN and len(call.args) > _CODE_IN[name]:
            code = call.args[_CODE_IN[name]]
            value = code.value if isinstance(code, ast.Constant) else constants.get(getattr(code, "id", ""))
            found |= {value} if isinstance(value, str) else set()
    return found
