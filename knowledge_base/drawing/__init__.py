"""Pictures of a world graph: objects as cards, facts between objects as arrows."""

from __future__ import annotations

from knowledge_base.drawing.picture import picture_of
from knowledge_base.drawing.rendering import arranged, to_svg
from knowledge_base.view import View

MOST_DRAWN = 150
"""Maximum number of objects in a picture; the picture states the number of omitted objects."""


def draw(world: View, thing: str | None = None, hops: int = 1) -> str:
    """Return the world graph, or the neighbourhood of an object, as an SVG document.

    Args:
        world: a present or past world.
        thing: the object in the centre; by default the picture shows the whole world.
        hops: maximum distance from `thing` in facts, 0 or more.

    Raises:
        UnknownNameError: the object is unknown.
    """
    return to_svg(arranged(picture_of(world, thing, hops, MOST_DRAWN)))
