"""Layout of a drawing as values: nested boxes, edges as polylines, placed texts. Renderers need no other input.

Lengths are pixels, y grows downwards, all places are absolute. Widths of texts are upper bounds, measured without a
font in DejaVu Sans, the widest of the usual sans-serif fonts.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from unicodedata import east_asian_width

Point = tuple[float, float]
Area = tuple[float, float, float, float]
"""x, y, width, height."""


class TextStyle(StrEnum):
    """The role of a text, which determines its font."""

    TITLE = "title"
    ABOUT = "about"
    NAME = "name"
    DETAIL = "detail"
    LABEL = "label"
    RULE = "rule"


class BoxKind(StrEnum):
    """The kind of a box, which determines its looks."""

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
    """A line of text: `x` is its left end, or its middle if `centred`; `y` is the baseline."""

    x: float
    y: float
    text: str
    style: TextStyle
    centred: bool = False


def column(rows: Iterable[tuple[str, TextStyle]], x: float, y: float, *, centred: bool = False) -> tuple[Text, ...]:
    """Return small texts below each other; `y` is the first baseline."""
    return tuple(Text(x, y + LINE_HEIGHT * number, text, style, centred) for number, (text, style) in enumerate(rows))


@dataclass(frozen=True, slots=True)
class DrawnEdge:
    """One or more transitions between two states, which may be inside the boxes of the scope.

    Attributes:
        source, target: names of the states; the initial pseudostate has the name `""`.
        points: from the source's border to the target's.
        label: its texts, on the line in the rectangle `area` (x, y, width, height).
        title: the full form of shortened labels.
        rule: whether contingency rules added it.
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
    """A rectangle with texts and contents.

    Attributes:
        kind, name: kind and name of its state, region or plot.
        x, y, width, height: its place and size.
        texts: its own texts.
        lines: heights of its dividing lines.
        title: the full form of shortened texts.
        rule: whether a contingency rule added it.
        boxes, edges: its contents.
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
        """Return the box and its contents at another place."""
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
    """Return the texts at another place."""
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
"""From one baseline of a small text to the next."""
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
    """Return an upper bound of a text's width."""
    ems = sum(_EM.get(character) or _unknown(character) for character in text)
    return ems * FONT_SIZES[style] * (_BOLDER if style in BOLD else 1.0)


def _unknown(character: str) -> float:
    return 1.05 if east_asian_width(character) in "FWA" else 0.85


def shorten(text: str, style: TextStyle, width: float) -> str:
    """Return the text, shortened with an ellipsis if it does not fit."""
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
    """Return the words on the necessary number of lines; shorten a word that is too long for a line."""
    lines: list[str] = []
    for word in words:
        if lines and text_width(f"{lines[-1]} {word}", style) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(shorten(word, style, width))
    return lines
