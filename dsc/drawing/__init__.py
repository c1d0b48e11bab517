"""Drawings of plots: `drawing.draw` lays out neutral boxes and edges (`layout`) and writes them as SVG (`svg`)."""

from dsc.drawing.drawing import draw, lay_out

__all__ = ["draw", "lay_out"]
