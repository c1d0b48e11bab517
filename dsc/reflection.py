"""Rows of the relations of a design and of a configuration, see `dsc.model.relations` (S1.6, S1.13, S1.17)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

from dsc.dynamic.library import Library
from dsc.dynamic.steps import candidates_of, is_planned
from dsc.engine.machine_state import MachineState
from dsc.model.actions import Trigger, component_of
from dsc.model.plot import ActionPlot
from dsc.model.states import DynamicState
from knowledge_base.facts import Value
from knowledge_base.language.syntax.expression import Constant
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.live_rows import Rows

_Row = tuple[Value, ...]
Running = tuple[str, ActionPlot]
"""The path of an active state, and the plot that runs inside it."""


def design_rows(library: Callable[[], Library]) -> dict[str, Rows]:
    """Return the providers of the relations of the design."""
    of_plot: dict[str, Callable[[ActionPlot, Library], Iterable[_Row]]] = {
        "dsc:plot": lambda plot, _: [(plot.name,)],
        "dsc:state": lambda plot, _: [(plot.name, name) for name, _, _ in plot.walk()],
        "dsc:uses": lambda plot, library: [(plot.name, part) for part in parts_of(plot, library)],
        "dsc:candidate": _candidates,
        "dsc:offers": lambda plot, _: [(plot.name, name) for name in plot.offers],
        "dsc:implements": lambda plot, _: [(plot.name, plot.implements)] if plot.implements else [],
        "dsc:when": lambda plot, _: [] if plot.when is None else [(plot.name, to_text(plot.when))],
        "dsc:emits": lambda plot, _: [(plot.name, event) for event in plot.emits],
        "dsc:answers": _answers,
        "dsc:concerns": lambda plot, _: [(plot.name, rule.label, step) for rule in plot.rules for step in rule.steps],
        "dsc:leads-to": _continuations,
        "dsc:triggers": lambda plot, _: [(plot.name, skill) for skill in skills_of(plot)],
        "dsc:touches": _touches,
    }

    def rows(read: Callable[[ActionPlot, Library], Iterable[_Row]]) -> Iterator[_Row]:
        present = library()
        for plot in present:
            yield from read(plot, present)

    return {name: partial(rows, read) for name, read in of_plot.items()}


def configuration_rows(
    active: Callable[[], Iterable[str]], running: Callable[[], Iterable[Running]], library: Callable[[], Library]
) -> dict[str, Rows]:
    """Return the providers of the relations of the active states.

    Args:
        active: returns the paths of the active states.
        running: returns the plots that run inside them, as from `running_plots`.
        library: returns the plots of the run.
    """
    return {
        "dsc:active": lambda: ((path,) for path in active()),
        "dsc:running": lambda: ((path, plot.name) for path, plot in running()),
        "dsc:step": lambda: (row for path, step in _steps(running()) for row in _actions(path, step, library())),
        "dsc:step-argument": lambda: (row for path, step in _steps(running()) for row in _arguments(path, step)),
    }


def running_plots(state: MachineState) -> Iterator[Running]:
    """Yield the plots that run inside active states; outer plots come first."""
    frame = state.root
    waiting = [] if frame is None else [("", frame)]
    while waiting:
        prefix, frame = waiting.pop(0)
        for host, inner in frame.children.items():
            yield f"{prefix}{host}", inner.compiled.plot
            waiting.append((f"{prefix}{host}/", inner))


def parts_of(plot: ActionPlot, library: Library) -> list[str]:
    """Return the names of the plots that a plot may run, in states, rules and handlers."""
    states = [state for _, state, _ in plot.walk() if isinstance(state, DynamicState)]
    found = [one.name for state in states for one in candidates_of(state, library)]
    return list(dict.fromkeys([*sorted(plot.uses()), *found]))


def skills_of(plot: ActionPlot) -> list[str]:
    """Return the skills that the states of a plot trigger, and those that its handlers listen to."""
    found = [action.trigger for action in plot.actions() if isinstance(action, Trigger)]
    listens = [one.listen.trigger for one in plot.handlers if one.listen is not None]
    return list(dict.fromkeys([*found, *listens]))


def _candidates(plot: ActionPlot, library: Library) -> Iterator[_Row]:
    for name, state, _ in plot.walk():
        if isinstance(state, DynamicState):
            yield from ((plot.name, name, one.name) for one in candidates_of(state, library))


def _answers(plot: ActionPlot, _: Library) -> Iterator[_Row]:
    yield from ((plot.name, rule.on, rule.label) for rule in plot.rules if rule.on is not None)
    yield from ((plot.name, handler.on, handler.label) for handler in plot.handlers)


def _continuations(plot: ActionPlot, _: Library) -> Iterator[_Row]:
    for rule in plot.rules:
        yield from ((plot.name, rule.label, then) for then in dict.fromkeys(one.then for one in rule.continuations))


def _touches(plot: ActionPlot, library: Library) -> Iterator[_Row]:
    seen: dict[str, None] = {}
    waiting = [plot.name]
    while waiting:
        name = waiting.pop()
        if name not in seen and name in library:
            seen[name] = None
            part = library.plot(name)
            waiting += parts_of(part, library)
            if any(is_planned(state) for _, state, _ in part.walk()):
                waiting += [one.name for one in library if one.implements]
    found = {name: None for one in seen for name in _components(library.plot(one))}
    yield from ((plot.name, component) for component in sorted(found))


def _components(plot: ActionPlot) -> Iterator[str]:
    commands = [one for reaction in plot.rules for one in reaction.do.command]
    commands += [one for reaction in plot.handlers for one in reaction.do.command]
    listens = [one.listen for one in plot.handlers if one.listen is not None]
    reached = map(component_of, (*plot.actions(), *commands, *listens))
    return (one for one in reached if one is not None)


def _steps(running: Iterable[Running]) -> Iterator[tuple[str, DynamicState]]:
    """Yield the steps of running plans, with the paths of their states."""
    for host, plot in running:
        if plot.generated:
            yield from (
                (f"{host}/{name}", one) for name, one, _ in plot.walk() if isinstance(one, DynamicState) and one.dynamic
            )


def _actions(path: str, step: DynamicState, library: Library) -> Sequence[_Row]:
    """Return the planning action of a step, or the plot without one; nothing if the library lacks the plots."""
    return [(path, one.implements or one.name) for one in candidates_of(step, library)][:1]


def _arguments(path: str, step: DynamicState) -> Iterator[_Row]:
    values = ((name, term.value) for name, term in step.arguments.items() if isinstance(term, Constant))
    return ((path, name, value) for name, value in values if isinstance(value, Value))
