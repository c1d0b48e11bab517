"""What a plot may use only in profile `scxml`: everything that would break the black box or the skill layer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dsc.engine.membership import asked_states
from dsc.errors import Finding
from dsc.model.actions import Block, Choose, Emit, ExternalAction, Internal, Log, Withdraw, flat
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import FinalState, HistoryState, OrthogonalState, State
from dsc.model.transitions import Source, Transition
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError

FIX = "write `profile: scxml` if the plot is to be an SCXML chart"


def check_profile(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Findings about what the plot's profile does not have."""
    if plot.profile == "scxml":
        return
    for name, state, path in nesting.states:
        if isinstance(state, HistoryState):
            yield _finding(plot, f"'{name}' is a history state", path)
        elif isinstance(state, FinalState):
            yield from _inside(plot, name, state.entry, (*path, "entry"))
        else:
            yield from _source(plot, name, state, path, nesting)


def _source(plot: ActionPlot, name: str, source: Source, path: Path, nesting: Nesting) -> Iterator[Finding]:
    if isinstance(source, OrthogonalState) and source.connectors:
        yield _finding(plot, f"'{name}' has connectors", (*path, "connectors"))
    if isinstance(source, State):
        for key, actions in source.blocks():
            if actions:
                yield from _inside(plot, name, actions, (*path, key))
    for inside, _, transition in nesting.leaving(path):
        yield from _transition(plot, name, transition, (*path, *inside))


def _inside(
    plot: ActionPlot, name: str, actions: Iterable[ExternalAction | Internal], path: Path
) -> Iterator[Finding]:
    if any(isinstance(action, Internal) for action in actions):
        yield _finding(plot, f"'{name}' has an internal action outside its transitions", path)


def _transition(plot: ActionPlot, name: str, transition: Transition, path: Path) -> Iterator[Finding]:
    if transition.also or transition.internal:
        yield _finding(plot, f"a transition of '{name}' is internal or has several targets", path)
    if transition.clear:
        yield _finding(plot, f"a transition of '{name}' clears histories", (*path, "clear"))
    if transition.guard is not None and asked_states(transition.guard):
        yield _finding(plot, f"a guard of '{name}' asks which states are active", (*path, "when"))
    if transition.do and any(_is_foreign(action) for action in flat(transition.do)):
        yield _finding(plot, f"a transition of '{name}' branches, logs or sends with a delay", path)


def _is_foreign(action: ExternalAction | Internal) -> bool:
    sent = isinstance(action, Emit) and (action.delay, action.id, action.into) != (None, None, None)
    return sent or isinstance(action, Block | Choose | Log | Withdraw)


def _finding(plot: ActionPlot, what: str, path: Path) -> Finding:
    return Finding(SchemaError(f"{what}, which only profile scxml has", place=plot.place(path)), "profile", FIX)
