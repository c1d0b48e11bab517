"""Application of an edit to the text of a plot file; the strict reader validates each result."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from dsc.editing.surgery.carried import Carried
from dsc.editing.surgery.cutting import cut, open_short, put, rewrite
from dsc.editing.surgery.edits import (
    Add,
    Edit,
    Move,
    Remove,
    RenameState,
    RenameVariable,
    Replace,
    edit_data,
    missing_parts,
    open_part,
    part,
    place,
    real_path,
    short_for,
    split,
)
from dsc.editing.surgery.renaming import rename
from dsc.editing.surgery.sheet import Sheet
from dsc.model.reading import FormPath
from dsc.text.plot_files import plot_in
from dsc.text.yaml import inline
from knowledge_base.errors import InputError


def apply(text: str, edit: Edit, source: str | None = None) -> str:
    """Return the text of a plot file after an edit; all other lines keep their bytes.

    Args:
        text: the text of a plot.
        edit: the edit.
        source: the file in messages.

    Raises:
        InputError: the text or the result is not a plot, in the reader's words; or the edit does not fit the plot.
    """
    sheet = Sheet(text, source)
    plot_in(sheet.document)
    if isinstance(edit, RenameState | RenameVariable):
        after = Sheet(rename(sheet, edit), source)
    else:
        after = Sheet(_operate(sheet, edit), source)
        if repr(after.data) != repr(edit_data(sheet.data, edit)):
            raise InputError("the text is written so that this edit would change other parts, too; edit it by hand")
    plot_in(after.document)
    return after.text


def _operate(sheet: Sheet, edit: Add | Remove | Replace | Move) -> str:
    match edit:
        case Add(path, value, before):
            return _insert(sheet, path, Carried.of_data(value), before)
        case Remove(path):
            return cut(sheet, real_path(sheet.data, path))
        case Replace(path, value):
            return _replace(sheet, real_path(sheet.data, path), value)
        case Move(path, to, before):
            real = real_path(sheet.data, path)
            return _insert(Sheet(cut(sheet, real)), to, Carried.of_part(sheet, real), before)


def _insert(sheet: Sheet, path: FormPath, carried: Carried, before: str | int | None) -> str:
    around, known = split(sheet.data, path)
    for missing, in_mapping in missing_parts(path, known):
        carried = carried.inside(missing, is_item=not in_mapping)
    key, inside = path[known], part(sheet.data, around)
    parts = open_part(inside, around, key)
    is_empty_way = inside == {} and isinstance(parts, list)
    if (inside or is_empty_way) and parts is not inside:
        word = short_for(around) if isinstance(parts, dict) else None
        return _insert(Sheet(open_short(sheet, around, word)), path, carried, before)
    return put(sheet, around, key, place(parts, around, key, before), carried)


def _replace(sheet: Sheet, path: FormPath, value: Any) -> str:
    carried = Carried.of_data(value)
    begin, end = sheet.spans.values[path]
    if sheet.in_lines(path) or (carried.in_lines and not sheet.in_brackets(path[:-1])):
        line = sheet.rest_of_line(sheet.value_begin(path) if sheet.in_lines(path) else end)
        return rewrite(sheet, path, replace(carried, head=line if line.lstrip().startswith("#") else carried.head))
    if begin == end:
        at = sheet.end(path)
        return f"{sheet.text[:at]} {inline(value)}{sheet.text[at:]}"
    ending = "\n" if sheet.text[:end].endswith("\n") else ""
    return f"{sheet.text[:begin]}{inline(value)}{ending}{sheet.text[end:]}"
