"""Random edits of all shipped plots: the meant model, comments, few lines, and an undo of the same bytes."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meant_models import form_of, meant
from random_plot_edits import Drawing

from dsc.editing.surgery import Add, Move, Remove, Replace, apply, differences, patch
from dsc.editing.surgery.edits import part, real_path, split
from dsc.editing.surgery.sheet import Sheet
from dsc.text.plot_files import parse_plot
from knowledge_base.errors import InputError

ROOT = Path(__file__).parents[3]
FILES = [
    file
    for folder in ("domains", "planning", "docs", "examples", "tests/support/cell", "tests/support/lasting_robot")
    for file in sorted((ROOT / folder).rglob("*.yaml"))
    if file.read_text("utf-8").startswith(("plot:", "#")) and "\nplot:" in "\n" + file.read_text("utf-8")
]
EDITS = 30
MARK = re.compile(r"# (apart|above|end) (\S+)$")


def comments(sheet, lines=None):
    """Return the comments of a text, or of a range of its lines, with their number."""
    found: Counter[str] = Counter()
    begin = 0
    for number, line in enumerate(sheet.text.splitlines(keepends=True)):
        for at, character in enumerate(line):
            if character == "#" and sheet.has_comment(begin + at, begin + at + 1):
                if lines is None or number in lines:
                    found[line[at:].strip()] += 1
                break
        begin += len(line)
    return found


def lines_of(sheet, begin, end):
    return set(range(sheet.text.count("\n", 0, begin), sheet.text.count("\n", 0, max(begin, end - 1)) + 1))


def lines_at(sheet, path):
    """Return the lines of an entry; in brackets those of all entries, else the line above, which names the parts."""
    around = path[:-1]
    if sheet.in_lines(around):
        own = lines_of(sheet, sheet.lead(path), sheet.stop(path))
        before, after = sheet.siblings(path)
        if before is None and after is None:
            return own | lines_of(sheet, sheet.begin(around), sheet.begin(path))
        return own | (lines_of(sheet, sheet.begin(after), sheet.begin(after)) if before is None else set())
    return lines_of(sheet, sheet.begin(around), sheet.end(around))


def lines_around(sheet, path):
    around, _ = split(sheet.data, path)
    if not around:
        return set()
    if sheet.in_lines(around):
        first = lines_of(sheet, sheet.begin(around), sheet.spans.values[around][0])
        return first | lines_of(sheet, sheet.begin(around), sheet.end(around)) if isinstance(path[-1], int) else first
    return lines_of(sheet, sheet.begin(around), sheet.end(around))


def check_lines(sheet, after, edit):
    """Require all lines that the edit does not concern, in their order."""
    text = sheet.text
    match edit:
        case Add(path):
            lines = lines_around(sheet, path)
        case Remove(path) | Replace(path):
            lines = lines_at(sheet, real_path(sheet.data, path))
        case Move(path, to):
            lines = lines_at(sheet, real_path(sheet.data, path)) | lines_around(sheet, to)
        case _:
            lines = {number for number, line in enumerate(text.splitlines()) if str(edit.path[-1]) in line}
    left = iter(after.splitlines())
    assert all(line in left for number, line in enumerate(text.splitlines()) if number not in lines)


def check_comments(sheet, after, edit):
    lost = comments(sheet) - comments(after)
    if isinstance(edit, Remove | Replace):
        assert lost <= comments(sheet, lines_at(sheet, real_path(sheet.data, edit.path)))
    else:
        assert not lost


def commented(text):
    """Return a plot with three comments for each part that has its own lines: apart, directly above, and at the end."""
    sheet, lines = Sheet(text), text.splitlines()
    for path in sorted({*sheet.spans.values} - {()}, key=sheet.begin, reverse=True):
        if sheet.in_brackets(path[:-1]) or not sheet.owns_line(path):
            continue
        name = "/".join(map(str, path))
        number = text.count("\n", 0, sheet.begin(path))
        if lines[number].endswith(":"):
            lines[number] += f"   # end {name}"
        indentation = " " * sheet.column(sheet.begin(path))
        lines[number:number] = [f"{indentation}# apart {name}", "", f"{indentation}# above {name}"]
    return "\n".join(lines) + "\n"


def marks(text, path):
    """Return the lines with comments of `commented`: those that go with a part, and all others."""
    name = "/".join(map(str, path))
    found = [(line, match) for line in text.splitlines() if (match := MARK.search(line))]
    own = [line for line, match in found if f"{match[2]}/".startswith(f"{name}/") and match[0] != f"# apart {name}"]
    return own, [line for line, _ in found if line not in own]


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parts[-3]}-{file.stem}")
@given(data=st.data())
@settings(max_examples=3)
def test_the_comments_of_a_removed_or_moved_state_and_of_all_others(file, data):
    text = commented(file.read_text("utf-8"))
    sheet = Sheet(text)
    paths = [path for _, _, path in parse_plot(text).walk() if not sheet.in_brackets(path[:-1])]
    path = data.draw(st.sampled_from([path for path in paths if sheet.siblings(path) != (None, None)]))
    own, others = marks(text, path)
    assert marks(apply(text, Remove(path)), path) == ([], others)
    before = data.draw(st.sampled_from([one for one in part(sheet.data, path[:-1]) if one != path[-1]]))
    moved = apply(text, Move(path, path, before))
    assert marks(moved, path) == (own, others)
    assert text[sheet.lead(path) : sheet.stop(path)] in moved


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parts[-3]}-{file.stem}")
@given(random=st.randoms(use_true_random=True))
@settings(max_examples=1)
def test_random_edits_of_a_shipped_plot(file, random):
    text = file.read_text("utf-8")
    drawing, undone, done = Drawing(random), [], 0
    for _ in range(EDITS):
        plot = parse_plot(text)
        edit = drawing.edit(plot)
        try:
            model = meant(plot, edit)
        except (ValueError, LookupError, InputError):
            with pytest.raises(InputError):
                apply(text, edit)
            continue
        try:
            after = apply(text, edit)
        except InputError as error:
            if "no place inside brackets" in str(error):
                continue
            raise
        assert json.dumps(form_of(parse_plot(after))) == json.dumps(form_of(model)), edit
        sheet = Sheet(text)
        check_comments(sheet, Sheet(after), edit)
        check_lines(sheet, after, edit)
        undone.append(differences(after, text))
        text = after
        done += 1
    assert done > EDITS // 3
    for edits in reversed(undone):
        text = patch(text, edits)
    assert text == file.read_text("utf-8")
