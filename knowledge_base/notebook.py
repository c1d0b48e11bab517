"""Display of values in notebooks: Jupyter calls the methods `_repr_svg_` and `_repr_html_` of a value."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from html import escape
from pkgutil import resolve_name
from typing import Any


def svg_by(function: str) -> Callable[[Any], str]:
    """Return a method `_repr_svg_` that calls the named function, e.g. `dsc.drawing:draw`.

    The name replaces an import, because the room that draws a value is above the room that defines the value.
    """

    def _repr_svg_(self: Any) -> str:
        return str(resolve_name(function)(self))

    return _repr_svg_


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table with a title as HTML."""
    lines = [f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in row)}</tr>" for row in rows]
    names = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f"<table><caption>{escape(title)}</caption><tr>{names}</tr>{''.join(lines)}</table>"


def text(lines: Iterable[str]) -> str:
    """Return lines of text as HTML."""
    return f"<pre>{escape(chr(10).join(lines))}</pre>"
