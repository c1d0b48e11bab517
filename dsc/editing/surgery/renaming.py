"""Rename of a state, parameter, variable or output in the text of a plot file."""

from __future__ import annotations

from dsc.editing.names import Occurrence, plot_names, variables_in
from dsc.editing.surgery.edits import RenameState, RenameVariable, real_path
from dsc.editing.surgery.sheet import Sheet
from dsc.editing.surgery.text_edits import TextEdit, patch
from knowledge_base.errors import InputError

_KINDS = {RenameState: "state", RenameVariable: "variable"}


def rename(sheet: Sheet, edit: RenameState | RenameVariable) -> str:
    """Return the text with another name at each place that means the old one.

    Raises:
        InputError: there is no such definition, the new name is in use, or it would mean another thing somewhere.
    """
    key = real_path(sheet.data, edit.path)
    kind, old, new = _KINDS[type(edit)], str(key[-1]), edit.new
    names = [one for one in plot_names(sheet.document, sheet.spans, sheet.text) if one.kind == kind]
    begin = sheet.spans.keys.get(key, (None,))[0]
    meant = next((one for one in names if one.defines and one.begin == begin), None)
    if meant is None:
        raise InputError(f"'{old}' is no {kind} that this plot defines", found=old)
    if new == old:
        return sheet.text
    names = [one for one in names if one.scope == meant.scope]
    if any(one.name == new for one in names) or (kind == "variable" and new in variables_in(sheet.document.data)):
        raise InputError(f"there is a {kind} '{new}' already, or a place that would mean it", found=new)
    places = [one for one in names if one.means(meant)]
    text = patch(sheet.text, (_edit(sheet, one, new) for one in places))
    after = Sheet(text)
    found = [
        one for one in plot_names(after.document, after.spans, text) if one.kind == kind and one.scope == meant.scope
    ]
    if len(found) != len(names) or sum(one.name == new for one in found) != len(places):
        raise InputError(f"'{new}' would not be read as a name everywhere; choose another one", found=new)
    return text


def _edit(sheet: Sheet, place: Occurrence, new: str) -> TextEdit:
    quote = sheet.text[place.begin] if sheet.text[place.begin] in {"'", '"'} else ""
    return TextEdit(place.begin, place.end, f"{quote}{new}{quote}")
