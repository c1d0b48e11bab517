"""What plots are handed, by `with` and by `pass`: names exist, and nothing that a plot needs is missing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from dsc.dynamic.library import Library
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Parameter, Path, initial_of
from dsc.model.states import DynamicState, HistoryState, SubmachineState
from dsc.model.transitions import Source, Transition
from knowledge_base.errors import InputError, SchemaError, UnknownNameError

Holder = SubmachineState | DynamicState
"""A state whose content is a plot."""


def check_arguments(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    """Findings about the arguments of used plots."""
    ways_in = list(_ways_in(plot, library))
    for name, state, path in plot.walk():
        if isinstance(state, Holder):
            yield from _known(plot, state, set(state.arguments), (*path, "with"), library)
            for need in _needs(state, library):
                yield from _given(plot, name, path, need, ways_in)
        if isinstance(state, Source):
            for inside, _, transition in state.placed_transitions():
                yield from _passed(plot, transition, (*path, *inside), library)
    for number, rule in enumerate(plot.rules):
        if rule.do.use is not None:
            used, here = library.plot(rule.do.use), ("rules", number, "do", "with")
            yield from _unknown(plot, used, set(rule.do.arguments), here)
            for name in _needed(used.parameters):
                if name not in rule.do.arguments:
                    yield _missing(plot, _Need(used.name, name), here)


def contents(state: Holder, library: Library) -> list[ActionPlot]:
    """The plots that may become the content of a state, as far as that is known."""
    if isinstance(state, DynamicState):
        return [library.plot(name) for name in state.dynamic]
    return [] if state.use.startswith("?") else [library.plot(state.use)]


# -- names ---------------------------------------------------------------------------------------------------


def _known(plot: ActionPlot, state: Holder, given: set[str], path: Path, library: Library) -> Iterator[Finding]:
    if isinstance(state, SubmachineState):
        for used in contents(state, library):
            yield from _unknown(plot, used, given, path)
        return
    taken = {name for candidate in contents(state, library) for name in candidate.parameters}
    for name in sorted(given - taken):
        error = UnknownNameError(
            f"no candidate has a parameter '{name}'",
            place=plot.place((*path, name)), found=name, valid=taken,
        )  # fmt: skip
        yield Finding(error, "candidates conform")


def _unknown(plot: ActionPlot, used: ActionPlot, given: set[str], path: Path) -> Iterator[Finding]:
    for name in sorted(given - set(used.parameters)):
        error = UnknownNameError(
            f"plot '{used.name}' has no parameter '{name}'",
            place=plot.place((*path, name)), found=name, valid=used.parameters,
        )  # fmt: skip
        yield Finding(error, "known parameter")


def _passed(plot: ActionPlot, transition: Transition, path: Path, library: Library) -> Iterator[Finding]:
    if not transition.passed:
        return
    target = None if transition.target is None else plot.state(transition.target)
    if isinstance(target, Holder):
        yield from _known(plot, target, set(transition.passed), (*path, "pass"), library)
        return
    where = "nowhere" if transition.target is None else f"to '{transition.target}', which holds no plot"
    error = SchemaError(f"arguments are passed by a transition that leads {where}", place=plot.place((*path, "pass")))
    yield Finding(error, "arguments are taken", "pass them to a state with `use` or `dynamic`")


# -- what must be given --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Need:
    """A parameter without default, and the plot that has it."""

    plot: str
    parameter: str


@dataclass(frozen=True, slots=True)
class _WayIn:
    """A transition of the plot with its rules carried out; `path` is `None` where a rule made it."""

    transition: Transition
    path: Path | None


def _needed(parameters: Mapping[str, Parameter]) -> Iterable[str]:
    return (name for name, parameter in parameters.items() if parameter.default is None)


def _needs(state: Holder, library: Library) -> Iterator[_Need]:
    """What `with` leaves open."""
    for used in contents(state, library):
        for name in _needed(used.parameters):
            if name not in state.arguments:
                yield _Need(used.name, name)


def _ways_in(plot: ActionPlot, library: Library) -> Iterator[_WayIn]:
    try:
        expanded = library.expanded(plot)
    except InputError:  # which is a finding about the wiring
        expanded = plot
    own = {name for name, _, _ in plot.walk()}
    for name, state, path in expanded.walk():
        if isinstance(state, Source):
            for inside, _, transition in state.placed_transitions():
                written = name in own and transition.rule is None
                yield _WayIn(transition, (*path, *inside) if written else None)


def _given(plot: ActionPlot, name: str, path: Path, need: _Need, ways_in: Iterable[_WayIn]) -> Iterator[Finding]:
    """A parameter that `with` leaves open is passed on every way into the state."""
    leading = [way for way in ways_in if name in way.transition.targets]
    passing = [way for way in leading if way.transition.target == name and need.parameter in way.transition.passed]
    if not passing:
        yield _missing(plot, need, (*path, "with"))
        return
    if _entered_by_default(plot, name):
        error = SchemaError(
            f"state '{name}' can be entered without a transition, but plot '{need.plot}' needs '{need.parameter}'",
            place=plot.place(path),
        )
        yield Finding(error, "parameters are given", f"add `{need.parameter}: …` under its `with`")
    for way in leading:
        if way not in passing:
            yield _not_passed(plot, name, path, need, way)


def _missing(plot: ActionPlot, need: _Need, path: Path) -> Finding:
    error = InputError(f"plot '{need.plot}' needs its parameter '{need.parameter}'", place=plot.place(path))
    return Finding(error, "parameters are given", f"add `{need.parameter}: …` under `with`")


def _not_passed(plot: ActionPlot, name: str, path: Path, need: _Need, way: _WayIn) -> Finding:
    rule = way.transition.rule
    by = "a transition" if way.path else f"the rule '{rule}'" if rule else "a rule's recovery"
    error = InputError(
        f"{by} leads to '{name}' and does not pass '{need.parameter}', which plot '{need.plot}' needs",
        place=plot.place(way.path or path),
    )
    fix = f"add `{need.parameter}: …` under its `pass`" if way.path else f"add `{need.parameter}: …` under `with`"
    return Finding(error, "parameters are given", fix)


def _entered_by_default(plot: ActionPlot, name: str) -> bool:
    """Whether the state begins its scope, or a history may bring it back."""
    firsts = {initial_of(scope) for scope in plot.scopes()}
    around = [path[:-2] for _, state, path in plot.walk() if isinstance(state, HistoryState)]
    defaults = {state.target for _, state, _ in plot.walk() if isinstance(state, HistoryState)}
    here = next(path for found, _, path in plot.walk() if found == name)
    return name in firsts | defaults or any(here[: len(scope)] == scope for scope in around)
