"""Reach of a plot: every state is entered from the first one, and connectors always lead to a state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, concerns
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Path, Scope, initial_of
from dsc.model.rules import ENTER
from dsc.model.states import AnyState, CompositeState, DynamicState, OrthogonalState, SubmachineState
from dsc.model.transitions import Connector
from dsc.validation.nesting import Nesting
from knowledge_base.errors import InputError, SchemaError


def check_connectors(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about choices and selections."""
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
                f"this branch of '{name}' has no `when`, so later branches are never reached",
                place=plot.place((*path, *inside)),
            )
            yield Finding(error, "choice", "give it a `when`, or put it last")
            return


def _targets(nesting: Nesting, path: Path) -> list[str]:
    return [target for _, _, transition in nesting.leaving(path) for target in transition.targets]


def circle_of(ways: Mapping[str, list[str]]) -> frozenset[str]:
    """Return the connectors of one cycle, or nothing; a second cycle is found after the repair of the first.

    Args:
        ways: connector -> its targets.
    """
    try:
        TopologicalSorter(ways).prepare()
    except CycleError as error:
        return frozenset(error.args[1])
    return frozenset()


def check_reach(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about unreachable states, empty dynamic states, and plots that use each other in a cycle.

    Connectors count as states. SCXML does not require that all states can be reached. A generated plot always has all
    its final states.
    """
    holders = [(state, path) for _, state, path in nesting.states if isinstance(state, Step)]
    yield from _circle(plot, _used(holders), library)
    yield from _empty_choices(plot, holders)
    if plot.dialect == "dsc" and not plot.generated:
        yield from _unreached(plot, library, nesting)


def _unreached(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    try:
        expanded = library.expanded(plot)
    except InputError:  # rules that cannot be applied have a separate finding
        return
    ways = nesting if expanded is plot else Nesting(expanded)
    responses = {rule.then for rule in plot.rules}  # the steps of plans may have outcomes that no state here has
    for name in _unreached_in(expanded, (), ways, responses):
        if name in nesting.names:
            yield _nothing_leads_to(name, plot, library, nesting)


def _nothing_leads_to(name: str, plot: ActionPlot, library: Library, nesting: Nesting) -> Finding:
    state, place = plot.state(name), plot.place(nesting.names[name])
    replacing = [rule for rule in plot.rules if rule.before and rule.when is None and rule.then != ENTER]
    for rule in replacing:
        if isinstance(state, Step) and concerns(rule, name, state, library):
            message = f"the rule '{rule.label}' always replaces step '{name}', which is never entered"
            error = SchemaError(message, place=place, found=name)
            return Finding(error, "reachable", "say with `when` when the rule does so")
    error = SchemaError(f"nothing leads to the state '{name}'", place=place, found=name)
    return Finding(error, "reachable", "add a transition to it, or make it `initial`")


def _unreached_in(scope: Scope, around: Path, ways: Nesting, responses: set[str]) -> Iterator[str]:
    """Yield states without a transition to them, but not their inner states; a transition stays in its scope (S0.3)."""
    reached: set[str] = set()
    waiting = [initial_of(scope), *responses]
    while waiting:
        name = waiting.pop()
        if name not in reached and name in scope.states:
            reached.add(name)
            leaving = ways.leaving((*around, "states", name))
            waiting += [transition.target for _, _, transition in leaving if transition.target is not None]
    for name, state in scope.states.items():
        path = (*around, "states", name)
        if name not in reached:
            yield name
        elif isinstance(state, CompositeState):
            yield from _unreached_in(state, path, ways, responses)
        elif isinstance(state, OrthogonalState):
            for key, region in state.regions.items():
                yield from _unreached_in(region, (*path, "regions", key), ways, responses)


def _empty_choices(plot: ActionPlot, holders: list[tuple[Step, Path]]) -> Iterator[Finding]:
    for state, path in holders:
        if isinstance(state, DynamicState) and not state.dynamic and state.goal is None:
            place = plot.place((*path, "dynamic"))
            error = SchemaError(f"the dynamic state '{path[-1]}' has nothing to choose from", place=place)
            yield Finding(error, "something to choose", "name candidates, or a `goal`")


def _circle(plot: ActionPlot, used: dict[str, Path], library: Library) -> Iterator[Finding]:
    """Yield the first cycle of submachine states that this plot leads to, directly or through other plots."""
    for name, path in used.items():
        circle = _found_circle([plot.name, name], library)
        if circle:
            error = SchemaError(
                f"plots use each other in a cycle: {' -> '.join(circle)}", place=plot.place((*path, "use")), found=name
            )
            yield Finding(error, "no circle", "choose one of them in a dynamic state")
            return


def _found_circle(way: list[str], library: Library) -> list[str]:
    """Search depth first along used plots; `way` is the plots entered so far, the last one not yet searched."""
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
            open_.append(iter(_used((state, path) for _, state, path in library.plot(name).walk())))
    return []


def _used(states: Iterable[tuple[AnyState, Path]]) -> dict[str, Path]:
    """Return the plots that submachine states name, each with the first state that does."""
    found: dict[str, Path] = {}
    for state, path in states:
        if isinstance(state, SubmachineState) and not state.use.startswith("?"):
            found.setdefault(state.use, path)
    return found
