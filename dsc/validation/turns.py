"""Review of parallel parts of a plot: warnings if their skills wait for each other at one component (S1.21)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from itertools import chain, combinations

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, contents_of, is_planned
from dsc.errors import Finding
from dsc.model.actions import Trigger, flat
from dsc.model.plot import Scope
from dsc.model.states import AnyState, CompositeState, OrthogonalState, State
from dsc.validation.subject import Subject

_FIX = "declare a `priority` in one of them, or `concurrent = True` in the component"


def waiting_parts(subject: Subject, exclusive: Collection[str]) -> Iterator[Finding]:
    """Yield warnings about regions and handlers whose skills wait for each other, unless a priority is declared.

    Args:
        subject: the plot.
        exclusive: the skills, as `component.skill`, of the components that execute one skill at a time.
    """
    if not exclusive:
        return
    for name, state, path in subject.states:
        if isinstance(state, OrthogonalState):
            yield from _regions(subject, name, state, (*path, "regions"), exclusive)
    yield from _handlers(subject, exclusive)


def _regions(
    subject: Subject, name: str, state: OrthogonalState, path: tuple[str | int, ...], exclusive: Collection[str]
) -> Iterator[Finding]:
    used = {key: _uses(region.states.values(), subject.library, exclusive) for key, region in state.regions.items()}
    for one, other in combinations(used, 2):
        for component in sorted(used[one] & used[other]):
            message = (
                f"the regions '{one}' and '{other}' of state '{name}' wait for each other at component '{component}',"
                " which executes one skill at a time"
            )
            yield subject.finding((*path, other), "turns", message, _FIX, level="warning")


def _handlers(subject: Subject, exclusive: Collection[str]) -> Iterator[Finding]:
    beside = [
        (number, one)
        for number, one in enumerate(subject.plot.handlers)
        if not (one.interrupt or one.preempt or one.priority is not None or one.do.use is None)
    ]
    if not beside:
        return
    own = _uses(subject.plot.states.values(), subject.library, exclusive)
    for number, handler in beside:
        used = [plot.states.values() for plot in subject.library if plot.name == handler.do.use]
        for component in sorted(own & _uses(chain.from_iterable(used), subject.library, exclusive)):
            message = (
                f"the '{handler.label}' waits for its plot at component '{component}',"
                " which executes one skill at a time"
            )
            fix = "declare `interrupt: true`, `preempt: true` or a `priority` here"
            yield subject.finding(("handlers", number), "turns", message, fix, level="warning")


def _uses(states: Iterable[AnyState], library: Library, exclusive: Collection[str]) -> set[str]:
    """Return the components whose skills these states and their contents start, without states with a priority."""
    found, seen = set[str](), set[str]()
    waiting = [*_inside(states)]
    while waiting:
        state = waiting.pop()
        triggers = [one.trigger for one in flat(state.entry) if isinstance(one, Trigger)]
        found.update(trigger.partition(".")[0] for trigger in triggers if trigger in exclusive)
        if isinstance(state, Step) and not is_planned(state):
            for plot in contents_of(state, library):
                waiting += [] if plot.name in seen else _inside(plot.states.values())
                seen.add(plot.name)
    return found


def _inside(states: Iterable[AnyState]) -> Iterator[State]:
    """Yield the states and all inner states, except those with a declared priority or preemption."""
    for state in states:
        if not isinstance(state, State) or state.priority is not None or state.preempt:
            continue
        yield state
        scopes: list[Scope] = []
        if isinstance(state, CompositeState):
            scopes = [state]
        elif isinstance(state, OrthogonalState):
            scopes = [*state.regions.values()]
        for scope in scopes:
            yield from _inside(scope.states.values())
