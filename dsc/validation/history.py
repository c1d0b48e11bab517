"""Histories: what they begin with is there, and what is forgotten was remembered (profile `scxml`)."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import CompositeState, HistoryState, OrthogonalState
from dsc.model.transitions import Transition
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError, UnknownNameError


def check_history(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Findings about histories and about transitions that clear them."""
    memory = _Memory(nesting)
    for _, state, path in nesting.states:
        if isinstance(state, HistoryState):
            yield from _default(plot, state, path, nesting)
        elif plot.profile == "scxml":
            for inside, _, transition in nesting.leaving(path):
                yield from _cleared(plot, transition, (*path, *inside, "clear"), memory)


def _default(plot: ActionPlot, state: HistoryState, path: Path, nesting: Nesting) -> Iterator[Finding]:
    """What a history leads to is inside the state that the history belongs to (SCXML 3.10)."""
    around = path[:-2]
    if not nesting.inside(state.target, around):
        error = UnknownNameError(
            f"there is no state '{state.target}' beside the history", place=plot.place((*path, "to")),
            found=state.target, valid=nesting.within(around),
        )  # fmt: skip
        yield Finding(error, "target")


class _Memory:
    """Which states have histories inside, gathered once.

    Attributes:
        holders: name -> path of the composite and orthogonal states.
        directly: paths of the states whose histories are directly inside, or in one of their regions.
        below: paths of the states with histories at any level.
    """

    def __init__(self, nesting: Nesting) -> None:
        self.holders: dict[str, Path] = {}
        self.directly: set[Path] = set()
        self.below: set[Path] = set()
        for name, state, path in nesting.states:
            if isinstance(state, CompositeState | OrthogonalState):
                self.holders[name] = path
            elif isinstance(state, HistoryState):
                around = list(nesting.way(path))[:-1]
                self.directly.update(around[-1:])
                self.below.update(around)


def _cleared(plot: ActionPlot, transition: Transition, path: Path, memory: _Memory) -> Iterator[Finding]:
    """Harel's clear-history needs a history: directly inside the state, or with `*` at any level below."""
    for number, written in enumerate(transition.clear):
        name, place = written.removesuffix("*"), plot.place((*path, number))
        remembering = memory.below if written.endswith("*") else memory.directly
        if name not in memory.holders:
            error = UnknownNameError(
                f"there is no composite or orthogonal state '{name}' with a history to clear",
                place=place, found=name, valid=memory.holders,
            )  # fmt: skip
            yield Finding(error, "clear")
        elif memory.holders[name] not in remembering:
            nothing = SchemaError(f"the state '{name}' has no history to clear", place=place, found=name)
            yield Finding(nothing, "clear", f"write \"{name}*\" to clear those of the levels below it")
