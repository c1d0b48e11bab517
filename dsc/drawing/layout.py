"""Layout of a drawing as values: nested boxes, edges as polylines, placed texts. Renderers need no other input.

Lengths are pixels, y grows downwards, all places are absolute.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

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
