"""A copy of the project for each room, in which mutmut mutates the room's modules."""

from __future__ import annotations

import ast
import json
import os
import shutil
from pathlib import Path

from rooms import ROOT, Room

PACKAGES = ("dsc", "planning", "knowledge_base", "domains")
BESIDE = ("examples", "docs", "frontend/src", "README.md", "CHANGELOG.md", "Makefile")
"""Files beside packages and tests that some test reads."""
SETTINGS = """
[tool.mutmut]
source_paths = {packages}
only_mutate = {modules}
also_copy = {beside}
pytest_add_cli_args_test_selection = {tests}
pytest_add_cli_args = ["-p", "no:cacheprovider", "--hypothesis-profile", "mutation"]
timeout_constant = 10.0  # seconds
timeout_multiplier = 3.0
track_dependencies = false
use_git_change_detection = false
"""


def workspace(room: Room) -> Path:
    """Bring the room's copy up to date and return its folder. Unchanged files keep their time, so verdicts stay."""
    folder = ROOT / ".mutation" / room.name
    (folder / "mutants").mkdir(parents=True, exist_ok=True)
    for name in (*PACKAGES, "tests", *BESIDE):
        _copy(ROOT / name, folder / name)
    for module in room.modules:
        _undecorate(ROOT / module, folder / module)
    settings = SETTINGS.format(
        packages=json.dumps(PACKAGES),
        modules=json.dumps(room.modules),
        beside=json.dumps(BESIDE),
        tests=json.dumps(room.tests),
    )
    (folder / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text() + settings)
    return folder


def _copy(source: Path, target: Path) -> None:
    if source.is_file():
        shutil.copy2(source, target)
        return
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", ".mutation"))


def _undecorate(source: Path, target: Path) -> None:
    """Copy a module with `@decorator` written as an assignment after the function: mutmut passes decorated ones over."""
    text = source.read_text()
    target.write_text(undecorated(text))
    at = source.stat()
    os.utime(target, ns=(at.st_atime_ns, at.st_mtime_ns))


def undecorated(text: str) -> str:
    """Return the same module without decorators on functions, except those that belong to the definition itself."""
    lines = text.splitlines()
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    for function in sorted(functions, key=lambda node: node.lineno, reverse=True):
        decorators = [ast.unparse(one) for one in function.decorator_list]
        if not decorators or any(_belongs(one) for one in decorators):
            continue
        indent = " " * function.col_offset
        value = function.name
        for one in reversed(decorators):
            value = f"{one}({value})"
        lines.insert(function.end_lineno or function.lineno, f"{indent}{function.name} = {value}")
        for number in range(function.decorator_list[0].lineno, function.lineno):
            lines[number - 1] = ""
    return "\n".join(lines) + "\n"


def _belongs(decorator: str) -> bool:
    """`@overload` declares, a setter extends, mutmut itself knows the methods of a class."""
    return decorator in {"overload", "staticmethod", "classmethod"} or decorator.endswith((".setter", ".register"))
