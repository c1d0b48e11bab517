"""Public names of package `dsc`: state charts, their run time, and the choice among plots with its reasons."""

from typing import Any

from knowledge_base._lazy import lazy_exports
from knowledge_base.notebook import register_drawing

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)


def _draw(plot: Any) -> str:
    from dsc.drawing import draw  # noqa: PLC0415  the first drawing loads the room

    return draw(plot)


register_drawing("plot", _draw)
