"""The world model: typed objects, facts and numbers in a graph, with one language for queries and changes."""

from typing import Any

from knowledge_base._lazy import lazy_exports
from knowledge_base.notebook import register_drawing

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)


def _draw(world: Any) -> str:
    from knowledge_base.drawing import draw  # noqa: PLC0415  the first drawing loads the room

    return draw(world)


register_drawing("world", _draw)
