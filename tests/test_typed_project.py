"""A project with lists, records, choices, optional values and conversions: planted mistakes in types are found (S2.21)."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from mypy import api

PROJECT = Path(__file__).parent / "support" / "seeing_project"
DSC = Path(sys.executable).with_name("dsc")

CHECKED = [
    ("plots/tidy.yaml", "least: {type: number from 0 to 1, default: 0.5}", "least: {type: number from 0 to 1, default: 50}",
     "'default' is a number from 0 to 1, not 50"),
    ("plots/tidy.yaml", "found: {type: list of detection, initial: []}", "found: {type: detection, initial: []}",
     "'initial' is of type detection, and [] is a list"),
    ("plots/tidy.yaml", "found: {type: list of detection,", "found: {type: list of detections,", "did you mean 'detection'?"),
    ("plots/tidy.yaml", "with: {area: {x: 0, size: 2.5}}", "with: {area: {x: left}}", "'x' is of type number, and left is of type text"),
    ("plots/tidy.yaml", "with: {area: {x: 0, size: 2.5}}", "with: {area: {y: 0}}", "has the part 'y', which a area lacks"),
    ("plots/tidy.yaml", "(> ?d.score ?least)", "(> ?d.kind ?least)", "'>' works on numbers, and ?d.kind is of type cup | can"),
    ("plots/tidy.yaml", "(> ?d.score ?least)", "(> ?d.scor ?least)", "did you mean 'score'?"),
    ("plots/tidy.yaml", "(seen ?d.item)", "(seen ?d)", "'?d' is of type detection, and a condition reads its parts"),
    ("plots/tidy.yaml", "(certain ?event.items ?least)", "(certain ?event.items)", "called as (certain ?items ?least)"),
    ("plots/tidy.yaml", "assign: {brought: (names ?found)}", "assign: {brought: ?found}",
     "'brought' is of type list of item, and ?found is of type list of detection"),
    ("plots/tidy.yaml", "[{item: ?found.0.item, to: ?to}]", "[{item: ?found.0.item, to: ?looks}]",
     "'to' is of type place, and ?looks is of type integer"),
    ("plots/tidy.yaml", "emit: nothing, with: {looks: ?looks}", "emit: nothing, with: {looks: ?brought}",
     "'looks' is of type integer, and ?brought is of type list of item"),
    ("plots/bring.yaml", "in m/s", "in km/h", "'speed' is of type number from 0 to 1 in m/s, and ?speed is in km/h"),
    ("plots/bring.yaml", "hand: optional left | right", "hand: optional front | back", "two records are named 'order'"),
    ("plots/bring.yaml", "hand: ?order.hand", "hand: middle", "'hand' is one of left, right, not 'middle'"),
]  # fmt: skip
"""File, text, mistake, and the answer of `dsc check`."""
TYPED = [
    ("Detection(item=Item(\"cup1\"), score=0.9,", "Detection(item=\"cup1\", score=0.9,"),
    ("kind=Kind.CAN)", "kind=\"can\")"),
    ("return Seen(items=[cup, can], observed=known)", "return Seen(items=cup, observed=known)"),
    ("return Taken(weight=0.2)", "return Taken(weight=\"light\")"),
    ("2.0 if hand is None else 1.0", "2.0 if hand == \"middle\" else 1.0"),
    ("return [one.item for one in items]", "return [one.kind for one in items]"),
    ("if one.score >= least]", "if one.pose[0] >= least]"),
]  # fmt: skip
"""Text and mistake, which `mypy --strict` reports."""
REFUSED = [
    ("class Put(Outcome): ...", "class Put(Outcome): ...\n\n\nclass Lost(Taken): ...", "Lost is a subclass of Taken"),
    ("self, call: SkillCall, item: Item, to: Place, speed: Speed", "self, call: SkillCall, *item: Item", "'*item' receives none"),
    ("def names(items: list[Detection]) -> list[Item]:", "def names(items: list[Detection]):", "has no return annotation"),
]  # fmt: skip
"""Text and mistake, and the answer when the class or function is made."""


def copy(folder: Path, file: str = "", old: str = "", new: str = "") -> Path:
    """Return a copy of the project with one text replaced."""
    shutil.copytree(PROJECT, folder / "project", ignore=shutil.ignore_patterns("__pycache__"))
    if file:
        path = folder / "project" / file
        text = path.read_text("utf-8")
        assert text.count(old) >= 1, old
        path.write_text(text.replace(old, new, 1), "utf-8")
    return folder / "project"


def check(project: Path) -> str:
    done = subprocess.run([DSC, "check", project], capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def test_the_project_has_no_finding(tmp_path):
    assert "no mistakes found" in check(copy(tmp_path))


@pytest.mark.parametrize(("file", "old", "new", "said"), CHECKED, ids=[said for *_, said in CHECKED])
def test_a_mistake_in_a_plot_is_found_by_the_check(tmp_path, file, old, new, said):
    found = check(copy(tmp_path, file, old, new))
    assert said in found
    assert re.search(r"plots/(tidy|bring)\.yaml:\d+:\d+", found)


@pytest.mark.parametrize(("old", "new", "said"), REFUSED, ids=[said for *_, said in REFUSED])
def test_a_mistake_in_a_declaration_is_found_when_it_is_made(tmp_path, old, new, said):
    found = check(copy(tmp_path, "seeing.py", old, new))
    assert said in found
    assert "seeing.py:" in found


def test_mistakes_in_python_are_found_by_the_type_checker(tmp_path):
    for number, (old, new) in enumerate(TYPED):
        text = (PROJECT / "seeing.py").read_text("utf-8")
        assert old in text
        (tmp_path / f"seeing_{number}.py").write_text(text.replace(old, new, 1), "utf-8")
    out, *_ = api.run(["--strict", str(PROJECT / "seeing.py"), *map(str, sorted(tmp_path.glob("*.py")))])
    found = set(re.findall(r"seeing_(\d+)\.py:\d+: error", out))
    assert found == set(map(str, range(len(TYPED))))
    assert not re.search(r"seeing\.py:\d+: error", out)
