"""Removal of an entry from the text of a plot file, and insertion of one."""

from __future__ import annotations

from typing import Any

from dsc.editing.surgery.carried import Carried
from dsc.editing.surgery.edits import part
from dsc.editing.surgery.sheet import Sheet
from dsc.model.reading import FormPath


def cut(sheet: Sheet, path: FormPath) -> str:
    """Return the text without an entry; in lines, the comments directly above are a part of it."""
    if len(part(sheet.data, path[:-1])) == 1:
        return _empty(sheet, path)
    return _cut_in_brackets(sheet, path) if sheet.in_brackets(path[:-1]) else _cut_in_lines(sheet, path)


def _cut_in_lines(sheet: Sheet, path: FormPath) -> str:
    begin = sheet.begin(path)
    if sheet.owns_line(path):
        return _without(sheet.text, sheet.lead(path), sheet.stop(path))
    _, after = sheet.siblings(path)  # the first part of a mapping or list behind a dash
    end = sheet.end(path)
    to = end if after is None or sheet.has_comment(end, sheet.begin(after)) else sheet.begin(after)
    return _without(sheet.text, begin, to)


def _cut_in_brackets(sheet: Sheet, path: FormPath) -> str:
    begin, end = sheet.begin(path), sheet.end(path)
    before, after = sheet.siblings(path)
    first, last = (
        (begin, sheet.begin(after)) if after is not None else (begin if before is None else sheet.end(before), end)
    )
    if not sheet.has_comment(first, last):
        return _without(sheet.text, first, last)
    comma = sheet.text.index(",", end if after is not None else first)
    if comma < begin:
        return sheet.text[:comma] + sheet.text[comma + 1 : begin] + sheet.text[end:]
    return sheet.text[:begin] + sheet.text[end:comma] + sheet.text[comma + 1 :]


def _empty(sheet: Sheet, path: FormPath) -> str:
    """Return the text without the only entry of a mapping or list, which gets empty brackets."""
    around = path[:-1]
    empty = "[]" if isinstance(part(sheet.data, around), list) else "{}"
    begin, end = sheet.begin(path), sheet.end(path)
    if sheet.in_brackets(around):
        comma = sheet.text[end : sheet.spans.values[around][1]].lstrip().startswith(",")
        return _without(sheet.text, begin, sheet.text.index(",", end) + 1 if comma else end)
    if not sheet.owns_line(path):
        return sheet.text[:begin] + empty + sheet.text[end:]
    begin, stop, anchor = sheet.lead(path), sheet.stop(path), sheet.value_begin(around)
    return f"{sheet.text[:anchor]} {empty}{sheet.text[anchor:begin]}{sheet.text[stop:]}"


def put(sheet: Sheet, around: FormPath, key: str | int, at: int, carried: Carried) -> str:
    """Return the text with a new entry.

    Args:
        sheet: the text.
        around: the path of the mapping or list.
        key: the new key; for a list, any number.
        at: the position among the entries.
        carried: the value.
    """
    inside: Any = part(sheet.data, around)
    is_item = isinstance(inside, list) or (inside is None and isinstance(key, int))
    if not inside:
        return _fill(sheet, around, key, carried, is_item=is_item)
    keys = [*inside] if isinstance(inside, dict) else list(range(len(inside)))
    if sheet.in_brackets(around):
        entry = carried.flow_entry(key, is_item=is_item)
        if at == 0:
            return _with(sheet.text, sheet.begin((*around, keys[0])), f"{entry}, ")
        return _with(sheet.text, _after_entry(sheet, (*around, keys[at - 1])), f", {entry}")
    first = (*around, keys[0])
    column = sheet.column(sheet.begin(first))
    lines = carried.entry(key, is_item=is_item, column=column)
    if at == 0 and not sheet.owns_line(first):
        return _with(sheet.text, sheet.begin(first), f"{lines}\n{' ' * column}")
    place = sheet.lead(first) if at == 0 else sheet.stop((*around, keys[at - 1]))
    if at == 0 or sheet.text[:place].endswith("\n"):
        return _with(sheet.text, place, f"{' ' * column}{lines}\n")
    return _with(sheet.text, place, f"\n{' ' * column}{lines}")


def _fill(sheet: Sheet, around: FormPath, key: str | int, carried: Carried, *, is_item: bool) -> str:
    """Return the text with the first entry of an empty part."""
    begin, end = sheet.spans.values[around]
    if begin == end:
        begin = end = sheet.end(around)
    after = sheet.rest_of_line(end)
    parent = around[:-1]
    if (carried.in_lines or carried.above) and around and not after.strip() and not sheet.in_brackets(parent):
        column = sheet.column(sheet.begin(around)) + 2
        lines = carried.entry(key, is_item=is_item, column=column)
        return f"{sheet.text[:begin].rstrip(' ')}\n{' ' * column}{lines}{sheet.text[end:]}"
    entry = carried.flow_entry(key, is_item=is_item)
    if sheet.text[begin:end][:1] in {"{", "["}:
        return _with(sheet.text, begin + 1, entry)
    entry = f"[{entry}]" if is_item else f"{{{entry}}}"
    space = "" if sheet.text[:begin].endswith(" ") else " "
    return f"{sheet.text[:begin]}{space}{entry}{sheet.text[end:]}"


def open_short(sheet: Sheet, path: FormPath, key: str | None) -> str:
    """Return the text with a short form in long form: a value as the only part of a list, or under a key."""
    begin, end = sheet.spans.values[path]
    if key is not None:
        return f"{sheet.text[:begin]}{{{key}: {sheet.flow_text(path)}}}{sheet.text[end:]}"
    if not sheet.in_lines(path):
        return f"{sheet.text[:begin]}[{sheet.flow_text(path)}]{sheet.text[end:]}"
    item = Carried.of_entry(sheet, path).inside(0, is_item=True)
    return rewrite(sheet, path, item)


def rewrite(sheet: Sheet, path: FormPath, carried: Carried) -> str:
    """Return the text with another value of an entry in lines; key and line break stay."""
    start, stop = sheet.value_begin(path), sheet.stop(path)
    is_item = path not in sheet.spans.keys
    value = carried.value(is_item=is_item, column=sheet.column(sheet.begin(path)))
    ending = "\n" if sheet.text[:stop].endswith("\n") else ""
    return f"{sheet.text[:start]}{value}{ending}{sheet.text[stop:]}"


def _after_entry(sheet: Sheet, path: FormPath) -> int:
    """Return where a comma may follow an entry in brackets; a colon without a value keeps a space."""
    end = sheet.end(path)
    return end + (sheet.text[end - 1] == ":" and sheet.text[end : end + 1] == " ")


def _with(text: str, at: int, new: str) -> str:
    return text[:at] + new + text[at:]


def _without(text: str, begin: int, end: int) -> str:
    return text[:begin] + text[end:]
