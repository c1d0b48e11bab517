"""Drawings of plots: `drawing` computes boxes and edges (`layout`), and `svg` writes these values as SVG."""

from dsc.drawing.drawing import draw, lay_out

__all__ = ["draw", "lay_out"]
