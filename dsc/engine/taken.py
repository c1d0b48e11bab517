"""Reports of taken transitions: immutable values, which tests, trace and replay read."""

from __future__ import annotations

from dataclasses import dataclass

from dsc.engine.tables import CompiledPlot, TransitionEdge


@dataclass(frozen=True, slots=True)
class Taken:
    """Report of a taken transition.

    Attributes:
        source, target: paths of the transition's states; `target` is `None` if no state was entered.
        trigger: the event, `after` or `always`.
        rule: label of the contingency rule whose expansion made the transition; `None` for any other transition.
        plot: name of the plot that contains the transition.
        place: keys of the transition in its source state, e.g. `("on", "grasped", 0)`.
    """

    source: str
    trigger: str
    target: str | None
    rule: str | None = None
    plot: str = ""
    place: tuple[str | int, ...] = ()


def report(edge: TransitionEdge, compiled: CompiledPlot, prefix: str = "") -> Taken:
    """Return the report of one taken transition; `prefix` is the beginning of the paths of the plot's states."""
    nodes = compiled.nodes
    target = prefix + nodes[edge.targets[0]].name if edge.targets else None
    return Taken(prefix + nodes[edge.source].name, edge.trigger, target, edge.rule, compiled.plot.name, edge.place)
