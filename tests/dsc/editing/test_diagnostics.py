from __future__ import annotations

from pathlib import Path

import pytest

from dsc.editing.diagnostics import FileFinding, by_file, diagnostics, on_same_lines
from dsc.editing.lines import Spot
from dsc.errors import Finding
from knowledge_base.errors import InputError, Place, UnknownNameError

TEXT = "plot: go # 🚪\nstates:\n  a: {on: {done: bb}}\n  b: {final: true}\n"


def finding(line: int | None, column: int | None, found: str | None = None, text: str = "wrong") -> FileFinding:
    return FileFinding("f.yaml", line, column, text, "target", "error", found, None)


@pytest.mark.parametrize(
    ("one", "part", "number"),
    [
        (finding(3, 12, "bb"), "bb", 2),  # the place is that of the key before the value
        (finding(3, 3), "a", 2),
        (finding(3, None), "a: {on: {done: bb}}", 2),
        (finding(None, None), "plot: go # 🚪", 0),
        (finding(2, 1, "bb"), "bb", 2),
        (finding(3, 12, "d"), "done", 2),  # not inside a longer name
    ],
)
def test_the_range_is_the_wrong_word_or_the_word_at_the_place_or_the_line(one, part, number):
    (found,) = diagnostics([one], TEXT)
    line = TEXT.splitlines()[number]
    assert line.index(part) == found.start.column
    assert (found.start.line, found.end.line) == (number, number)
    assert found.end.column - found.start.column == len(part.encode("utf-16-le")) // 2


def test_a_place_behind_the_text_is_at_its_end():
    (found,) = diagnostics([finding(99, 7)], TEXT)
    assert found.start == found.end == Spot(4, 0)


def test_equal_findings_are_one_diagnostic():
    assert len(diagnostics([finding(3, 3), finding(3, 3)], TEXT)) == 1


def test_a_finding_keeps_its_nearest_name_and_its_source():
    error = UnknownNameError("no state 'bb'", place=Place("/p/f.yaml", 3, 12), found="bb", valid=["b"])
    found = FileFinding.of(Finding(error, "target", "write b"), Path("other.yaml"))
    assert (found.file, found.found, found.nearest, found.line) == ("/p/f.yaml", "bb", "b", 3)
    assert found.text.endswith("(write b)")
    assert FileFinding.of(Finding(InputError("no"), "goal"), Path("other.yaml")).file == "other.yaml"


def test_findings_of_changed_lines_are_dropped_and_files_are_grouped():
    old = [finding(3, 3, text="same"), finding(4, 3, text="edited")]
    assert [one.text for one in on_same_lines(old, TEXT, TEXT.replace("b: {final", "c: {final"))] == ["same"]
    assert by_file(old, str.upper) == {"F.YAML": old}
