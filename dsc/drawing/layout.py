"""A drawing as values: boxes in boxes, edges as polylines, texts with places. Renderers need nothing else.

Lengths are pixels, y grows downwards, all places are absolute.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

Point = tuple[float, float]
Area = tuple[float, float, float, float]
"""x, y, width, height."""


class TextStyle(StrEnum):
    """What a text is; fonts follow from it."""

    TITLE = "title"
    ABOUT = "about"
    NAME = "name"
    DETAIL = "detail"
    LABEL = "label"
    RULE = "rule"


class BoxKind(StrEnum):
    """What a box stands for; its looks follow from it."""

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
    """A transition, or several between the same two states, which may be deeper inside the boxes around.

    Attributes:
        source, target: names of the states; the initial pseudo-state has the name `""`.
        points: from the source's border to the target's.
        label: its texts, which stand on the line in the rectangle `area` (x, y, width, height).
        title: everything the label had to shorten.
        rule: whether contingency rules put it there.
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
    """A rectangle with texts, and what is inside.

    Attributes:
        kind, name: what it stands for.
        x, y, width, height: where it is.
        texts: its own texts.
        lines: heights at which a line divides it.
        title: everything the texts had to shorten.
        rule: whether a contingency rule put it there.
        boxes, edges: what is inside.
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
        """The box, with all that is in it, somewhere else."""
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
    """The texts somewhere else."""
    return tuple(replace(text, x=text.x + dx, y=text.y + dy) for text in texts)


def _moved_edge(edge: DrawnEdge, dx: float, dy: float) -> DrawnEdge:
    area = edge.area and (edge.area[0] + dx, edge.area[1] + dy, *edge.area[2:])
    points = tuple((x + dx, y + dy) for x, y in edge.points)
    return replace(edge, points=points, label=moved_texts(edge.label, dx, dy), area=area)
