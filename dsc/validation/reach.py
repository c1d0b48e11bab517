"""Checks of reach: states can be entered and completed, connectors lead to a state, plots form no cycle."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import chain

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, candidates_of, concerns
from dsc.errors import Finding
from dsc.events import DONE
from dsc.model.actions import Trigger
from dsc.model.plot import ActionPlot, Path, Scope, initial_of
from dsc.model.rules import ENTER
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    OrthogonalState,
    State,
    SubmachineState,
)
from dsc.model.transitions import Connector, TransitionSource
from dsc.validation.subject import Subject
from knowledge_base.errors import InputError


def check_connectors(subject: Subject) -> Iterator[Finding]:
    """Yield findings about choice and select connectors, e.g. about cycles of connectors."""
    connectors = {name: path for name, state, path in subject.states if isinstance(state, Connector)}
    circle = circle_of({
        name: [target for _, _, way in subject.leaving(path) for target in way.targets]
        for name, path in connectors.items()
    })  # fmt: skip
    for name, path in connectors.items():
        yield from _branches(subject, name, path)
        if name in circle:
            message = f"connectors lead from '{name}' back to it"
            fix = "let one of them lead to a state, where a run can rest"
            yield subject.finding(path, "connectors-lead-on", message, fix, found=name)


def _branches(subject: Subject, name: str, path: Path) -> Iterator[Finding]:
    *earlier, (last_path, _, last) = subject.leaving(path)
    if last.has_guard:
        key = "bind" if last.guard is None else "when"
        message = f"'{name}' may lead nowhere: its last branch has a `{key}`"
        yield subject.finding(last_path, "choice", message, f"end with a branch without `{key}`")
    for here, _, transition in earlier:
        if not transition.has_guard:
            message = f"this branch of '{name}' has no `when`, so later branches are never reached"
            yield subject.finding(here, "choice", message, "give it a `when`, or put it last")
            return


def circle_of(ways: Mapping[str, Iterable[str]]) -> list[str]:
    """Return a cycle of a graph as nodes, the first node also at the end; empty if the graph has no cycle.

    Args:
        ways: targets of each node.
    """
    try:
        TopologicalSorter(ways).prepare()
    except CycleError as error:
        circle: list[str] = error.args[1]
        return circle[::-1]  # the search collects the nodes backwards
    return []


def check_reach(subject: Subject) -> Iterator[Finding]:
    """Yield findings about unreachable states, empty dynamic states, and plots that use each other in a cycle.

    Connectors count as states. SCXML allows unreachable states. A generated plot may have unreachable final states,
    because it always has a final state for each outcome.
    """
    yield from _circle(subject)
    for name, state, path in subject.steps:
        if isinstance(state, DynamicState) and not state.candidates and state.offer is None and state.goal is None:
            message = f"the dynamic state '{name}' has nothing to choose from"
            fix = "name candidates, or a `goal`"
            yield subject.finding((*path, "dynamic"), "something-to-choose", message, fix)
    if subject.strict and not subject.plot.generated:
        yield from _find_unreached(subject)


def _find_unreached(subject: Subject) -> Iterator[Finding]:
    try:
        expanded = subject.library.expanded(subject.plot)
    except InputError:  # another check reports rules that cannot be applied
        return
    ways = subject if expanded is subject.plot else Subject(expanded, subject.library)
    continuations = chain.from_iterable(rule.continuations for rule in subject.plot.rules)
    responses = {one.then for one in continuations}  # only steps of plans may have the outcomes of these rules
    for name in _unreached_in(expanded, (), ways, responses):
        if name in subject.names:
            yield _nothing_leads_to(name, subject)


def _nothing_leads_to(name: str, subject: Subject) -> Finding:
    state, path = subject.state(name), subject.names[name]
    for rule in subject.plot.rules:
        replaces = rule.before and rule.when is None and rule.then != ENTER
        if replaces and isinstance(state, Step) and concerns(rule, name, state, subject.library):
            message = f"the rule '{rule.label}' always replaces step '{name}', which is never entered"
            return subject.finding(path, "reachable", message, "give the rule a `when`", found=name)
    fix = "add a transition to it, or make it `initial`"
    return subject.finding(path, "reachable", f"nothing leads to the state '{name}'", fix, found=name)


def _unreached_in(scope: Scope, around: Path, ways: Subject, responses: set[str]) -> Iterator[str]:
    """Yield unreachable states, without their inner states; each transition stays in its scope (S0.3)."""
    reached: set[str] = set()
    waiting = [initial_of(scope), *responses]
    while waiting:
        name = waiting.pop()
        if name not in reached and name in scope.states:
            reached.add(name)
            leaving = ways.leaving((*around, "states", name))
            waiting += [way.target for _, _, way in leaving if way.target is not None]
    for name, state in scope.states.items():
        path = (*around, "states", name)
        if name not in reached:
            yield name
        elif isinstance(state, CompositeState):
            yield from _unreached_in(state, path, ways, responses)
        elif isinstance(state, OrthogonalState):
            for key, region in state.regions.items():
                yield from _unreached_in(region, (*path, "regions", key), ways, responses)


def _circle(subject: Subject) -> Iterator[Finding]:
    """Yield a finding about the first cycle of plots that this plot reaches through submachine states."""
    own, used = subject.plot.name, _find_uses(subject.states)
    for name, path in used.items():
        circle = circle_of({**_uses(name, subject.library), own: used})
        if circle:
            start = circle.index(own) if own in circle else 0
            way = " -> ".join([*circle[start:-1], *circle[: start + 1]])
            message, fix = f"plots use each other in a cycle: {way}", "choose one of them in a dynamic state"
            yield subject.finding((*path, "use"), "no-circle", message, fix, found=name)
            return


def _uses(name: str, library: Library) -> dict[str, Iterable[str]]:
    """Return for each plot that `name` uses directly or indirectly the plots that its submachine states use."""
    found: dict[str, Iterable[str]] = {}
    waiting = [name]
    while waiting:
        one = waiting.pop()
        if one not in found and one in library:
            found[one] = _find_uses(library.plot(one).walk())
            waiting += found[one]
    return found


def _find_uses(states: Iterable[tuple[str, AnyState, Path]]) -> dict[str, Path]:
    """Return the path of the first submachine state that uses a plot, by the name of this plot."""
    found: dict[str, Path] = {}
    for _, state, path in states:
        if isinstance(state, SubmachineState) and not state.use.startswith("?"):
            found.setdefault(state.use, path)
    return found


# -- completion ----------------------------------------------------------------------------------------------


def check_completion(subject: Subject, wired: Mapping[str, AnyState]) -> Iterator[Finding]:
    """Yield findings about transitions on `done`; `wired` contains the states of the expanded plot by name."""
    silent = cache(lambda used: _ends_silently(subject.library.plot(used)))  # several states may use the same plot
    for name, state, path in subject.states:
        if type(state) is State and DONE in state.on and any(isinstance(a, Trigger) for a in state.entry):
            message = f"state '{name}' has no content, so it is done immediately and would cancel its skill"
            yield subject.finding((*path, "on", DONE), "done-at-once", message, "wire the outcome of the skill")
        after = wired[name]
        if not isinstance(after, State):
            continue
        if DONE not in after.on and _completes(state, subject.library, silent):
            message = f"state '{name}' does not handle its completion"
            yield subject.finding((*path, "on"), "completion-is-wired", message, "add `done: STATE` under `on`")
        elif isinstance(state, State) and DONE in state.on and (endless := _endless(state, subject.library)):
            message = f"state '{name}' is never done: {endless} has no final state"
            yield subject.finding((*path, "on", DONE), "done-can-fire", message, "remove `done`, or add an end")


def _completes(state: AnyState, library: Library, silent: Callable[[str], bool]) -> bool:
    match state:
        case SubmachineState(use=use):
            return use.startswith("?") or silent(use)
        case DynamicState():
            return state.goal is not None or any(silent(one.name) for one in candidates_of(state, library))
        case CompositeState(states=inside):
            return _has_end(inside)
        case OrthogonalState(regions=regions):
            return all(_has_end(region.states) for region in regions.values())
        case _:
            return False


def _has_end(states: Mapping[str, AnyState]) -> bool:
    return any(isinstance(state, FinalState) for state in states.values())


def _endless(state: State, library: Library) -> str | None:
    """Return the part of a state without a final state, so that the state is never done; `None` if it may be done."""
    match state:
        case CompositeState(states=inside):
            return None if _has_end(inside) else "it"
        case OrthogonalState(regions=regions):
            endless = (f"its region '{name}'" for name, region in regions.items() if not _has_end(region.states))
            return next(endless, None)
        case SubmachineState(use=use):
            return None if use.startswith("?") or _has_end(library.plot(use).states) else f"plot '{use}'"
        case DynamicState(goal=None):
            candidates = candidates_of(state, library)
            return "each candidate" if candidates and not any(_has_end(one.states) for one in candidates) else None
        case _:
            return None


def _ends_silently(plot: ActionPlot) -> bool:
    """Return whether the plot can reach a top-level final state but fire no declared outcome."""
    states = [state for state in plot.states.values() if isinstance(state, State)]
    waiting = {initial_of(plot)}.union(*(_silent_ways(plot, state) for state in states))
    seen: set[str] = set()
    while waiting:  # follow only transitions that fire no outcome
        name = waiting.pop()
        seen.add(name)
        reached = plot.states.get(name)
        if isinstance(reached, FinalState) and reached.emit is None:
            return True
        if isinstance(reached, Connector):
            waiting |= _silent_ways(plot, reached) - seen
    return False


def _silent_ways(plot: ActionPlot, source: TransitionSource) -> set[str]:
    """Return the targets of transitions that fire no declared outcome."""
    silent = (one for _, one in source.transitions() if not set(one.emitted) & set(plot.emits))
    return {transition.target for transition in silent if transition.target is not None}
