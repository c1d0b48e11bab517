"""Pictures of a world: things as cards, what joins them as arrows."""

from __future__ import annotations

from knowledge_base.drawing.picture import picture_of
from knowledge_base.drawing.placement import arranged
from knowledge_base.drawing.rendering import to_svg
from knowledge_base.view import View

MOST_DRAWN = 150
"""Things in one picture; of more nobody sees anything, and the picture says how many are left out."""


def draw(world: View, thing: str | None = None, hops: int = 1) -> str:
    """The world's graph as an SVG document, or the neighbourhood of a thing.

    Args:
        world: what is drawn, present or past.
        thing: the middle of the picture; the whole world when left out.
        hops: how many facts away from it things are still drawn, 0 or more.

    Raises:
        UnknownNameError: there is no such thing.
    """
    return to_svg(arranged(picture_of(world, thing, hops, MOST_DRAWN)))
