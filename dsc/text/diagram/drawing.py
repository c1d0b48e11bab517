"""Draw a plot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.text.diagram.build import build
from dsc.text.diagram.layout import Box
from dsc.text.diagram.svg import NO_MARKS, to_svg

Direction = Literal["down", "right"]


def draw(
    plot: ActionPlot,
    library: Library | None = None,
    *,
    rules: bool = True,
    direction: Direction = "down",
    marks: Mapping[str, str] = NO_MARKS,
) -> str:
    """The plot as SVG; the same plot gives the same text.

    Args:
        plot: what to draw.
        library: where the plots it uses are found. With it, rules are carried out and drawn as the states and
            transitions they become, and dynamic states say when each candidate fits.
        rules: `False` only lists the rules.
        direction: where the flow goes.
        marks: what is said of states beyond what they are, by name: `active`, `added`, `removed`, `changed`.

    Raises:
        UnknownNameError: a transition leads nowhere, or a rule or state names a plot that is not there.
    """
    return to_svg(lay_out(plot, library, rules=rules, direction=direction), marks)


def lay_out(
    plot: ActionPlot, library: Library | None = None, *, rules: bool = True, direction: Direction = "down"
) -> Box:
    """The drawing as values, for other renderers; arguments and errors as for `draw`."""
    return build(plot, library, rules=rules, sideways=direction == "right")
