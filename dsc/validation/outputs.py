"""What plots hand back (S2.1): every output has a value when the plot ends."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dsc.errors import Finding
from dsc.model.actions import Assign, ExternalAction, Internal, flat
from dsc.model.plot import ActionPlot
from dsc.model.states import AnyState, FinalState, State
from dsc.model.transitions import Source
from knowledge_base.errors import SchemaError


def check_outputs(plot: ActionPlot) -> Iterator[Finding]:
    """Findings about outputs that nothing gives a value."""
    open_ones = [name for name, output in plot.outputs.items() if output.initial is None]
    if not open_ones:
        return
    assigned = {name for _, state, _ in plot.walk() for name in _assigned(_actions(state))}
    for name in open_ones:
        if name not in assigned:
            error = SchemaError(f"the output '{name}' never gets a value", place=plot.place(("outputs", name)))
            yield Finding(error, "outputs are given", "`assign` it on the way to the end, or add `initial`")


def _assigned(actions: Iterable[ExternalAction | Internal]) -> Iterator[str]:
    return (name for action in flat(actions) if isinstance(action, Assign) for name in action.assign)


def _actions(state: AnyState) -> Iterator[ExternalAction | Internal]:
    if isinstance(state, State):
        for _, actions in state.blocks():
            yield from actions
    if isinstance(state, Source):
        for _, transition in state.transitions():
            yield from transition.effect
    else:
        yield from state.entry if isinstance(state, FinalState) else state.do
