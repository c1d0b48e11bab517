"""Edits of a plot file's text, which keep its comments, order and style."""

from dsc.editing.surgery.edits import Add, Edit, Move, Remove, RenameState, RenameVariable, Replace
from dsc.editing.surgery.operation import apply
from dsc.editing.surgery.text_edits import TextEdit, differences, patch

__all__ = [
    "Add",
    "Edit",
    "Move",
    "Remove",
    "RenameState",
    "RenameVariable",
    "Replace",
    "TextEdit",
    "apply",
    "differences",
    "patch",
]
