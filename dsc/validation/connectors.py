"""Connectors always lead on: the last way is open, no way is dead, and none goes round in a circle."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter

from dsc.errors import Finding
from dsc.model.connectors import Connector
from dsc.model.plot import ActionPlot, Path
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError


def check_connectors(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Findings about choices and selections."""
    connectors = {name: path for name, state, path in nesting.states if isinstance(state, Connector)}
    circle = circle_of({name: _targets(nesting, path) for name, path in connectors.items()})
    for name, path in connectors.items():
        yield from _branches(plot, name, path, nesting)
        if name in circle:
            error = SchemaError(f"connectors lead from '{name}' back to it", place=plot.place(path), found=name)
            yield Finding(error, "connectors lead on", "let one of them lead to a state, where a run can rest")


def _branches(plot: ActionPlot, name: str, path: Path, nesting: Nesting) -> Iterator[Finding]:
    *earlier, last = nesting.leaving(path)
    if last[2].guard is not None:
        place = plot.place((*path, *last[0]))
        error = SchemaError(f"'{name}' may lead nowhere: its last branch has a `when`", place=place)
        yield Finding(error, "choice", "end with a branch without `when`")
    for inside, _, transition in earlier:
        if transition.guard is None:
            error = SchemaError(
                f"what follows this branch of '{name}' is never reached: it has no `when`",
                place=plot.place((*path, *inside)),
            )
            yield Finding(error, "choice", "give it a `when`, or put it last")
            return


def _targets(nesting: Nesting, path: Path) -> list[str]:
    return [target for _, _, transition in nesting.leaving(path) for target in transition.targets]


def circle_of(ways: Mapping[str, list[str]]) -> frozenset[str]:
    """The connectors of one circle; a second one is found when the first is mended.

    Args:
        ways: connector -> where it leads.
    """
    try:
        TopologicalSorter(ways).prepare()
    except CycleError as error:
        return frozenset(error.args[1])
    return frozenset()
