"""Pictures of plots: a neutral layout in `layout`, drawn as SVG by `svg`; begin with `drawing.draw`."""

from dsc.drawing.drawing import draw, lay_out

__all__ = ["draw", "lay_out"]
