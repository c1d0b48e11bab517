"""Events, attributes and arguments of a plot, by name: the alphabet of a controller."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dsc.controllers.expressions import RefusedError, Typing, kind_of
from dsc.controllers.model import Arguments, Kind
from dsc.controllers.refusals import Refusals
from dsc.data_types import data_type
from dsc.engine.tables import CompiledPlot
from dsc.engine.transition_selection import matches
from dsc.events import CYCLE, DONE, DONE_STATE, ERROR, ERRORS, EXECUTION_ERROR, TIMED_OUT
from dsc.model.actions import Configure, Emit, ExternalAction, Internal, Send, Trigger, flat
from dsc.model.language import TermField
from dsc.model.states import CompositeState, FinalState, HistoryState, OrthogonalState, State

AnyAction = ExternalAction | Internal


def actions_of(compiled: CompiledPlot) -> Iterator[AnyAction]:
    """Yield all actions of a plot, also those of transitions, histories and final states."""
    for node in compiled.nodes:
        state = node.state
        yield from flat((*node.entry, *node.exit, *node.broken))
        if isinstance(state, HistoryState):
            yield from flat(state.do)
        elif isinstance(state, FinalState):
            if state.emit is not None:
                yield Emit(emit=state.emit, arguments=state.arguments)
        elif state is not None:
            for _, _, transition in state.placed_transitions():
                yield from flat(transition.effect)


def completed_events(compiled: CompiledPlot) -> dict[int, str]:
    """Return the completion events of dialect `scxml`, by node."""
    kinds = CompositeState | OrthogonalState
    return {one.index: DONE_STATE + one.name for one in compiled.nodes if isinstance(one.state, kinds)}


def event_names(compiled: CompiledPlot) -> tuple[list[str], int]:
    """Return the names of all events by number, and the first number that may be posted; 0 means no event."""
    plot, actions = compiled.plot, [*actions_of(compiled)]
    inner = ["", DONE, EXECUTION_ERROR if compiled.scxml else ERROR]
    inner += completed_events(compiled).values() if compiled.scxml else ()
    inner += [CYCLE] if plot.robot is not None else []
    labels = [label for node in compiled.nodes if isinstance(node.state, State) for label in node.state.on]
    if compiled.scxml:
        words = (word.removesuffix(".*").removesuffix(".") for label in labels for word in label.split())
        labels = [word for word in words if word != "*" and word.partition(".")[0] not in {DONE, ERROR}]
    fired = [one.emit for one in actions if isinstance(one, Emit)]
    limited = [TIMED_OUT for one in actions if isinstance(one, Trigger) and one.within is not None]
    outer = dict.fromkeys((*plot.receives, *labels, *fired, *plot.emits, *limited))
    return [*inner, *(name for name in outer if name not in inner)], len(inner)


def error_numbers(names: list[str]) -> tuple[int, ...]:
    """Return the numbers of the events of failed evaluations."""
    return tuple(number for number, name in enumerate(names) if name in ERRORS)


def triggers(compiled: CompiledPlot, label: str, event: str) -> bool:
    """Return whether transitions with this label react to an event."""
    return matches(label, event) if compiled.scxml else label == event


def arguments_of(action: AnyAction) -> Mapping[str, TermField]:
    """Return the terms of the arguments of a skill or command, by name."""
    match action:
        case Trigger(arguments=terms) | Send(arguments=terms):
            return terms
        case Configure(to=term):
            return {"value": term}
        case _:
            return {}


def declare_attributes(compiled: CompiledPlot, kinds: dict[str, Kind], refusals: Refusals) -> None:
    """Add the kinds of the declared attributes of events."""
    for group, events in (("receives", compiled.plot.receives), ("emits", compiled.plot.emits)):
        for event, declared in events.items():
            for name, text in (declared or {}).items():
                with refusals.at((group, event, name)):
                    join(kinds, name, kind_of(data_type(text), f"the attribute '{name}' of '{event}'"))


def join(kinds: dict[str, Kind], name: str, kind: Kind) -> None:
    """Add a kind of a name: a number includes integers; raise `RefusedError` for a name of two kinds."""
    before = kinds.setdefault(name, kind)
    if before != kind:
        if "boolean" in {before, kind}:
            raise RefusedError(f"'{name}' is a truth value at one place, and a number at another one")
        kinds[name] = "number"


def join_all(
    kinds: dict[str, Kind], values: Iterable[Mapping[str, TermField]], typing: Typing, refusals: Refusals
) -> None:
    """Add the kinds of arguments; it omits those without a type, which are refused at their own places."""
    for terms in values:
        for name, term in terms.items():
            try:
                kind = typing.value(term).kind
            except RefusedError:
                continue
            with refusals.at(()):
                join(kinds, name, kind)


def convert(arguments: Mapping[str, TermField], kinds: Mapping[str, Kind], typing: Typing) -> Arguments:
    """Return arguments as typed values of the kinds that their names have."""
    return tuple((name, typing.convert(typing.value(term), kinds[name])) for name, term in arguments.items())
