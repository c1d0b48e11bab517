"""Display of values in notebooks: Jupyter calls the methods `_repr_svg_` and `_repr_html_` of a value."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import Any

Draw = Callable[[Any], str]
"""A function that returns the SVG of a value."""
_drawings: dict[str, Draw] = {}


def register_drawing(kind: str, draw: Draw) -> None:
    """Draw the values of a kind by this function: the room that draws them is above the room that defines them."""
    _drawings[kind] = draw


def svg_of(kind: str) -> Draw:
    """Return a method `_repr_svg_` for the values of a kind, see `register_drawing`."""

    def _repr_svg_(self: Any) -> str:
        return _drawings[kind](self)

    return _repr_svg_


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table with a title as HTML."""
    lines = [f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in row)}</tr>" for row in rows]
    names = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f"<table><caption>{escape(title)}</caption><tr>{names}</tr>{''.join(lines)}</table>"


def text(lines: Iterable[str]) -> str:
    """Return lines of text as HTML."""
    return f"<pre>{escape(chr(10).join(lines))}</pre>"
