"""Layout of a drawing as values: nested boxes, edges as polylines, and placed texts; a renderer needs no other input.

Lengths are in pixels, y grows downwards, and all coordinates are absolute. Widths of texts are upper bounds: they are
computed from the widths in DejaVu Sans, the widest of the usual sans-serif fonts.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from unicodedata import east_asian_width

Point = tuple[float, float]
Area = tuple[float, float, float, float]
"""A rectangle: x, y, width and height."""


class TextStyle(StrEnum):
    """The role of a text, which determines its font."""

    TITLE = "title"
    ABOUT = "about"
    NAME = "name"
    DETAIL = "detail"
    LABEL = "label"
    RULE = "rule"


class BoxKind(StrEnum):
    """The kind of a box, which determines its shape and colours."""

    PLOT = "plot"
    GENERATED = "generated"
    SIMPLE = "simple"
    COMPOSITE = "composite"
    ORTHOGONAL = "orthogonal"
    REGION = "region"
    SUBMACHINE = "submachine"
    DYNAMIC = "dynamic"
    FINAL = "final"
    CHOICE = "choice"
    BULLSEYE = "bullseye"
    HISTORY = "history"
    CIRCLE = "circle"
    INITIAL = "initial"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text; `x` is the text's left end, or its middle if `centred`, and `y` is the baseline."""

    x: float
    y: float
    text: str
    style: TextStyle
    centred: bool = False


def column(rows: Iterable[tuple[str, TextStyle]], x: float, y: float, *, centred: bool = False) -> tuple[Text, ...]:
    """Return small texts in a column; `y` is the baseline of the first text."""
    return tuple(Text(x, y + LINE_HEIGHT * number, text, style, centred) for number, (text, style) in enumerate(rows))


@dataclass(frozen=True, slots=True)
class DrawnEdge:
    """An edge: one or more transitions between two states, which may be inside the boxes of the edge's scope.

    Attributes:
        source, target: names of both states; the initial pseudostate has the name `""`.
        points: corners of the polyline, from the source's border to the target's border.
        label: texts of the edge, inside the rectangle `area` (x, y, width, height).
        title: full text of the label, for a tooltip.
        rule: whether contingency rules added the edge.
    """

    source: str
    target: str
    points: tuple[Point, ...]
    label: tuple[Text, ...] = ()
    area: Area | None = None
    title: str = ""
    rule: bool = False


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle with texts, inner boxes and inner edges.

    Attributes:
        kind, name: kind and name of the state, region or plot that the box represents.
        x, y: coordinates of the upper left corner.
        width, height: size of the box.
        texts: texts of the box itself.
        lines: y coordinates of the horizontal dividing lines.
        title: full form of shortened texts, for a tooltip.
        rule: whether a contingency rule added the element.
        boxes, edges: inner boxes and inner edges.
    """

    kind: BoxKind
    name: str
    x: float
    y: float
    width: float
    height: float
    texts: tuple[Text, ...] = ()
    lines: tuple[float, ...] = ()
    title: str = ""
    rule: bool = False
    boxes: tuple[Box, ...] = ()
    edges: tuple[DrawnEdge, ...] = ()

    def moved(self, dx: float, dy: float) -> Box:
        """Return the box and its content, moved by `dx` and `dy`."""
        return replace(
            self,
            x=self.x + dx,
            y=self.y + dy,
            texts=moved_texts(self.texts, dx, dy),
            lines=tuple(line + dy for line in self.lines),
            boxes=tuple(box.moved(dx, dy) for box in self.boxes),
            edges=tuple(_moved_edge(edge, dx, dy) for edge in self.edges),
        )


def moved_texts(texts: tuple[Text, ...], dx: float, dy: float) -> tuple[Text, ...]:
    """Return the texts, moved by `dx` and `dy`."""
    return tuple(replace(text, x=text.x + dx, y=text.y + dy) for text in texts)


def _moved_edge(edge: DrawnEdge, dx: float, dy: float) -> DrawnEdge:
    area = edge.area and (edge.area[0] + dx, edge.area[1] + dy, *edge.area[2:])
    points = tuple((x + dx, y + dy) for x, y in edge.points)
    return replace(edge, points=points, label=moved_texts(edge.label, dx, dy), area=area)


FONT_SIZES = {
    TextStyle.TITLE: 16.0,
    TextStyle.ABOUT: 12.0,
    TextStyle.NAME: 13.0,
    TextStyle.DETAIL: 11.5,
    TextStyle.LABEL: 11.5,
    TextStyle.RULE: 11.5,
}
LINE_HEIGHT = 15.0
"""Distance between the baselines of successive small texts."""
BOLD = frozenset({TextStyle.TITLE, TextStyle.NAME})
_BOLDER = 1.12

_EM = {
    character: width
    for width, characters in {
        0.29: "ijlIJ' ",
        0.35: ",./:;\\|f-",
        0.41: "()[]t!r",
        0.51: '"*_`sz',
        0.56: "?cLFk",
        0.61: "vxyPTYaoe",
        0.64: "ESbdghnpqu$0123456789{}",
        0.70: "KAVBRXZC",
        0.79: "UHNDG&OQ",
        0.85: "w#+<=>^~M",
        1.0: "%mW@",
    }.items()
    for character in characters
}
ELLIPSIS = "…"


def text_width(text: str, style: TextStyle) -> float:
    """Return an upper bound of a text's width in pixels."""
    ems = sum(_EM.get(character) or _unknown(character) for character in text)
    return ems * FONT_SIZES[style] * (_BOLDER if style in BOLD else 1.0)


def _unknown(character: str) -> float:
    return 1.05 if east_asian_width(character) in "FWA" else 0.85


def shorten(text: str, style: TextStyle, width: float) -> str:
    """Return the text; a text wider than `width` is shortened and ends in an ellipsis."""
    if text_width(text, style) <= width:
        return text
    low, high = 0, len(text)
    while low < high:
        middle = (low + high + 1) // 2
        if text_width(text[:middle] + ELLIPSIS, style) <= width:
            low = middle
        else:
            high = middle - 1
    return text[:low].rstrip() + ELLIPSIS


def pack(words: list[str], style: TextStyle, width: float) -> list[str]:
    """Return lines of words, each at most `width` wide; a word that is wider than a line is shortened."""
    lines: list[str] = []
    for word in words:
        if lines and text_width(f"{lines[-1]} {word}", style) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(shorten(word, style, width))
    return lines
