"""Text diagrams: plots in the forms of Mermaid (stateDiagram-v2) and PlantUML, which have similar syntax."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dsc.drawing.captions import block_texts, full_text, labelled, seconds_text
from dsc.model.plot import ActionPlot, Path, Scope, initial_of
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    HistoryState,
    OrthogonalState,
    State,
    SubmachineState,
)
from dsc.model.transitions import Connector, TransitionSource
from knowledge_base.errors import UnknownNameError


def to_mermaid(plot: ActionPlot) -> str:
    """Return the plot as a Mermaid state diagram; raise `UnknownNameError` if a target is missing."""
    return "\n".join(["stateDiagram-v2", *_Writer(plot, hulls_have_rows=False).lines()]) + "\n"


def to_plantuml(plot: ActionPlot) -> str:
    """Return the plot as a PlantUML state diagram; raise `UnknownNameError` if a target is missing."""
    lines = _Writer(plot, hulls_have_rows=True).lines()
    return "\n".join(["@startuml", f"title {plot.name}", *lines, "@enduml"]) + "\n"


class _Writer:
    """Writer of one diagram; it generates an alias for each state, because a state's name may contain any character.

    Mermaid allows no rows of text in states with inner states. With `hulls_have_rows=False`, the titles of these states
    contain the text.
    """

    def __init__(self, plot: ActionPlot, *, hulls_have_rows: bool) -> None:
        require_targets(plot)
        self._plot, self._hulls_have_rows = plot, hulls_have_rows
        self._alias = {name: f"s{number}" for number, (name, _, _) in enumerate(plot.walk(), start=1)}

    def lines(self) -> Iterator[str]:
        yield from self._scope(self._plot, "  ")
        for name, state, _ in self._plot.walk():
            yield from self._edges(name, state)

    def _scope(self, scope: Scope, indent: str) -> Iterator[str]:
        yield from self._states(scope.states, indent)
        yield f"{indent}[*] --> {self._alias[initial_of(scope)]}"

    def _states(self, states: Mapping[str, AnyState], indent: str) -> Iterator[str]:
        for name, state in states.items():
            if isinstance(state, Connector):  # Mermaid and PlantUML allow no title for a choice
                yield f"{indent}state {self._alias[name]} <<choice>>"
                continue
            rows = [_safe(text) for text in _rows(state)]
            in_title = isinstance(state, CompositeState | OrthogonalState) and not self._hulls_have_rows
            title = "<br/>".join([_safe(_title(name, state)), *(rows if in_title else ())])
            yield f'{indent}state "{title}" as {self._alias[name]}'
            if isinstance(state, CompositeState | OrthogonalState):
                yield f"{indent}state {self._alias[name]} {{"
                yield from self._inside(state, indent + "  ")
                yield f"{indent}}}"
            if isinstance(state, FinalState):
                yield f"{indent}{self._alias[name]} --> [*]"
            if not in_title:
                yield from (f"{indent}{self._alias[name]} : {text}" for text in rows)

    def _inside(self, state: CompositeState | OrthogonalState, indent: str) -> Iterator[str]:
        if isinstance(state, CompositeState):
            yield from self._scope(state, indent)
            return
        for number, region in enumerate(state.regions.values()):
            if number:
                yield f"{indent}--"
            else:
                yield from self._states(state.connectors, indent)
            yield from self._scope(region, indent)

    def _edges(self, name: str, state: AnyState) -> Iterator[str]:
        if isinstance(state, HistoryState):
            yield f"  {self._alias[name]} --> {self._alias[state.target]}"
        if not isinstance(state, TransitionSource):
            return
        for one in labelled(state):
            text = _safe(full_text(one))
            label = f" : {text}" if text else ""
            for target in one.transition.targets:
                yield f"  {self._alias[name]} --> {self._alias[target]}{label}"


def _rows(state: AnyState) -> Iterator[str]:
    """Yield the rows of a state's text: least duration, actions, and events that do not exit the state."""
    if not isinstance(state, State):
        return
    if state.at_least is not None:
        yield f"at least {seconds_text(state.at_least)}"
    yield from block_texts(state)
    yield from (full_text(one) for one in labelled(state) if one.transition.target is None)


def _title(name: str, state: AnyState) -> str:
    match state:
        case HistoryState(history=depth):
            return f"{name} (H{'*' if depth == 'deep' else ''})"
        case FinalState(emit=str(event)):
            return f"{name} ^{event}"
        case SubmachineState(use=use):
            return f"{name} = {use}"
        case DynamicState(offer=str(offer)):
            return f"{name} = one that offers {offer}"
        case DynamicState(candidates=candidates):
            return f"{name} = one of {', '.join(candidates) or 'the planned plots'}"
        case _:
            return name


def _safe(text: str) -> str:
    """Return a text without quotes, colons, semicolons and line ends, which are special in both forms."""
    return " ".join(text.split()).replace('"', "'").replace(":=", "=").replace(":", ".").replace(";", ",")


def require_targets(plot: ActionPlot) -> None:
    """Raise `UnknownNameError` if an initial state or target is not a state of the plot."""
    names = [name for name, _, _ in plot.walk()]
    for target, path in _references(plot):
        if target not in names:
            place = plot.place(path)
            raise UnknownNameError(f"there is no state '{target}'", place=place, found=target, valid=names)


def _references(plot: ActionPlot) -> Iterator[tuple[str, Path]]:
    """Yield name and path of each reference to a state in the plot."""
    yield initial_of(plot), ("initial",)
    for _, state, path in plot.walk():
        if isinstance(state, CompositeState):
            yield initial_of(state), (*path, "initial")
        elif isinstance(state, OrthogonalState):
            yield from ((initial_of(one), (*path, "regions", key, "initial")) for key, one in state.regions.items())
        elif isinstance(state, HistoryState):
            yield state.target, (*path, "to")
        if isinstance(state, TransitionSource):
            for inside, _, transition in state.placed_transitions():
                yield from ((target, (*path, *inside, "to")) for target in transition.targets)
