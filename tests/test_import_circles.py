"""Modules import each other without circles; imports for types only, inside functions, and relative ones count."""

from __future__ import annotations

import graphlib

import house
import pytest

TEMPLATE = house.ROOT / "planning" / "project_template"


@pytest.mark.parametrize(
    "files", [house.modules(*house.SOURCES), sorted(TEMPLATE.rglob("*.py"))], ids=["product", "project template"]
)
def test_modules_have_no_import_circle(files):
    assert house.circles(files) == []
    below = {house.module_name(file): house.imported(file, {*map(house.module_name, files)}) for file in files}
    assert len([*graphlib.TopologicalSorter(below).static_order()]) == len(files) > 1


@pytest.mark.parametrize("package", house.SOURCES)
def test_rooms_have_no_import_circle(package):
    """The import contracts omit imports for types only."""
    below: dict[str, set[str]] = {}
    for one, other in house.arrows(package):
        below.setdefault(one, set()).add(other)
    graphlib.TopologicalSorter(below).prepare()


def test_a_circle_of_relative_imports_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(house, "ROOT", tmp_path)
    package = tmp_path / "robot"
    package.mkdir()
    texts = {"__init__": "", "skills": "def f():\n    from .world import World", "world": "from . import skills"}
    for name, text in texts.items():
        (package / f"{name}.py").write_text(text)
    assert house.circles(sorted(package.glob("*.py"))) == [["robot.skills", "robot.world"]]


def test_lines_of_code_are_those_without_comments_docstrings_and_blank_lines():
    assert house.code_lines('"""Doc."""\n\nA = 1  # one\n# two\n\n\ndef f():\n    """Doc."""\n    return (\n        A\n    )\n') == {
        3, 7, 9, 10, 11,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "banned"), [("_go_on", True), ("CarryOut", True), ("GAVE_UP", True), ("going", False)]
)
def test_names_with_words_that_the_prose_check_bans_are_found(name, banned):
    assert house.is_banned(name) is banned
