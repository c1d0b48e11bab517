"""What can be entered at all: every state from the first one, and every used plot without using itself for ever."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.dynamic.library import Library
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Path, Scope, initial_of
from dsc.model.states import CompositeState, DynamicState, OrthogonalState, State, SubmachineState
from knowledge_base.errors import InputError, SchemaError


def check_reach(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    """Findings about states that nothing leads to, choices of nothing, and plots that use each other in a circle.

    SCXML has no rule that all states can be reached, and a generated plot has its ends whether they are needed or not.
    """
    yield from _circle(plot, library)
    yield from _empty_choices(plot)
    if plot.profile == "dsc" and not plot.generated:
        yield from _unreached(plot, library)


def _unreached(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    try:
        expanded = library.expanded(plot)
    except InputError:  # rules that cannot be carried out have a finding of their own
        return
    written = {path for _, _, path in plot.walk()}
    responses = {rule.do.then for rule in plot.rules}  # the steps of plans may end with what no state here does
    for path in _unreached_in(expanded, (), responses):
        if path in written:
            error = SchemaError(f"nothing leads to the state '{path[-1]}'", place=plot.place(path), found=str(path[-1]))
            yield Finding(error, "reachable", "add a transition to it, or make it `initial`")


def _unreached_in(scope: Scope, around: Path, responses: set[str]) -> Iterator[Path]:
    """The states that nothing leads to, without what is inside them; a transition stays in its scope (S0.3)."""
    reached: set[str] = set()
    waiting = [initial_of(scope), *responses]
    while waiting:
        name = waiting.pop()
        if name in reached or name not in scope.states:
            continue
        reached.add(name)
        state = scope.states[name]
        if isinstance(state, State):
            waiting += [target for _, transition in state.transitions() for target in transition.targets]
    for name, state in scope.states.items():
        path = (*around, "states", name)
        if name not in reached:
            yield path
        elif isinstance(state, CompositeState):
            yield from _unreached_in(state, path, responses)
        elif isinstance(state, OrthogonalState):
            for key, region in state.regions.items():
                yield from _unreached_in(region, (*path, "regions", key), responses)


def _empty_choices(plot: ActionPlot) -> Iterator[Finding]:
    for name, state, path in plot.walk():
        if isinstance(state, DynamicState) and not state.dynamic and state.goal is None:
            place = plot.place((*path, "dynamic"))
            error = SchemaError(f"the dynamic state '{name}' has nothing to choose from", place=place)
            yield Finding(error, "something to choose", "name candidates, or a `goal`")


def _circle(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    """The first circle of submachine states that this plot runs into; its own or one further down."""
    used = _used(plot)
    for name, path in used.items():
        circle = _found_circle([plot.name, name], library)
        if circle:
            error = SchemaError(
                f"plots use each other in a circle: {' -> '.join(circle)}", place=plot.place((*path, "use")), found=name
            )
            yield Finding(error, "no circle", "choose one of them in a dynamic state")
            return


def _found_circle(way: list[str], library: Library) -> list[str]:
    """Depth first along what is used; `way` is the plots entered so far, the last of them not yet looked into."""
    seen = set(way[:-1])
    open_: list[Iterator[str]] = [iter((way[-1],))]
    way = way[:-1]
    while open_:
        name = next(open_[-1], None)
        if name is None:
            open_.pop()
            way.pop()
        elif name in way:
            return [*way[way.index(name) :], name]
        elif name not in seen and name in library:
            seen.add(name)
            way.append(name)
            open_.append(iter(_used(library.plot(name))))
    return []


def _used(plot: ActionPlot) -> dict[str, Path]:
    """The plots that submachine states name, each with the first state that does."""
    found: dict[str, Path] = {}
    for _, state, path in plot.walk():
        if isinstance(state, SubmachineState) and not state.use.startswith("?"):
            found.setdefault(state.use, path)
    return found
