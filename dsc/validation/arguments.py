"""What plots are handed, by `with` and by `pass`: names exist, and nothing that a plot needs is missing."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, concerns, contents_of
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Parameter, Path, initial_of
from dsc.model.rules import Reaction, Rule
from dsc.model.states import HistoryState, SubmachineState
from dsc.model.transitions import Source, Transition
from dsc.validation.nesting import Nesting
from knowledge_base.errors import InputError, SchemaError, UnknownNameError


def check_arguments(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Findings about the arguments of used plots."""
    entrances = _Entrances(plot, library, nesting)
    for name, state, path in nesting.states:
        if isinstance(state, Step):
            yield from _known(plot, state, set(state.arguments), (*path, "with"), library)
            for need in _needs(state, library):
                yield from _given(plot, name, path, need, entrances)
        for inside, _, transition in nesting.leaving(path):
            if transition.passed:
                yield from _passed(plot, transition, (*path, *inside), library, nesting)
    for number, rule in enumerate(plot.rules):
        yield from _used(plot, rule.do, ("rules", number, "do"), library)
        yield from _passed_by_rule(plot, rule, ("rules", number, "do", "pass"), library, nesting)
    for number, handler in enumerate(plot.handlers):
        yield from _used(plot, handler.do, ("handlers", number, "do"), library)


def _used(plot: ActionPlot, do: Reaction, path: Path, library: Library) -> Iterator[Finding]:
    if do.use is None:
        return
    used, here = library.plot(do.use), (*path, "with")
    yield from _unknown(plot, used, set(do.arguments), here)
    for name in _needed(used.parameters):
        if name not in do.arguments:
            yield _missing(plot, _Need(used.name, name), here)


def _passed_by_rule(
    plot: ActionPlot, rule: Rule, path: Path, library: Library, nesting: Nesting
) -> Iterator[Finding]:
    """Some step that the rule is for takes what it passes; others are not handed it."""
    if not rule.do.passed:
        return
    steps = [(name, state) for name, state, _ in nesting.states if isinstance(state, Step)]
    if rule.then in nesting.names:
        entered = [state for name, state in steps if name == rule.then]
    else:
        entered = [state for name, state in steps if concerns(rule, name, state, library)]
    used = [one for state in entered for one in contents_of(state, library)]
    if rule.then not in nesting.names:  # steps of plans
        used += [one for one in library if one.implements and (not rule.steps or one.implements in rule.steps)]
    taken = {name for one in used for name in one.parameters}
    for name in sorted(set(rule.do.passed) - taken):
        error = UnknownNameError(
            f"no plot that is entered then has a parameter '{name}'",
            place=plot.place((*path, name)), found=name, valid=taken,
        )  # fmt: skip
        yield Finding(error, "known parameter")


# -- names ---------------------------------------------------------------------------------------------------


def _known(plot: ActionPlot, state: Step, given: set[str], path: Path, library: Library) -> Iterator[Finding]:
    if isinstance(state, SubmachineState):
        for used in contents_of(state, library):
            yield from _unknown(plot, used, given, path)
        return
    taken = {name for candidate in contents_of(state, library) for name in candidate.parameters}
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


def _passed(
    plot: ActionPlot, transition: Transition, path: Path, library: Library, nesting: Nesting
) -> Iterator[Finding]:
    target = None if transition.target is None else nesting.state(transition.target)
    if isinstance(target, Step):
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


def _needs(state: Step, library: Library) -> Iterator[_Need]:
    """What `with` leaves open."""
    for used in contents_of(state, library):
        for name in _needed(used.parameters):
            if name not in state.arguments:
                yield _Need(used.name, name)


class _Entrances:
    """How states are entered, gathered when it is first asked for: in most plots `with` leaves nothing open."""

    def __init__(self, plot: ActionPlot, library: Library, nesting: Nesting) -> None:
        self._plot = plot
        self._library = library
        self._nesting = nesting

    @cached_property
    def ways(self) -> Mapping[str, list[_WayIn]]:
        """State -> the transitions that lead to it."""
        try:
            expanded = self._library.expanded(self._plot)
        except InputError:  # which is a finding about the wiring
            expanded = self._plot
        found: defaultdict[str, list[_WayIn]] = defaultdict(list)
        for name, state, path in expanded.walk():
            for inside, _, transition in state.placed_transitions() if isinstance(state, Source) else ():
                written = name in self._nesting.names and transition.rule is None
                way = _WayIn(transition, (*path, *inside) if written else None)
                for target in transition.targets:
                    found[target].append(way)
        return found

    def by_default(self, name: str, path: Path) -> bool:
        """Whether the state begins its scope, or a history may bring it back."""
        return name in self._defaults or any(path[:length] in self._remembered for length in range(len(path)))

    @cached_property
    def _defaults(self) -> set[str]:
        histories = {state.target for _, state, _ in self._nesting.states if isinstance(state, HistoryState)}
        return histories | {initial_of(scope) for scope in self._plot.scopes()}

    @cached_property
    def _remembered(self) -> set[Path]:
        return {path[:-2] for _, state, path in self._nesting.states if isinstance(state, HistoryState)}


def _given(plot: ActionPlot, name: str, path: Path, need: _Need, entrances: _Entrances) -> Iterator[Finding]:
    """A parameter that `with` leaves open is passed on every way into the state."""
    leading = entrances.ways.get(name, [])
    silent = [way for way in leading if way.transition.target != name or need.parameter not in way.transition.passed]
    if len(silent) == len(leading):
        yield _missing(plot, need, (*path, "with"))
        return
    if entrances.by_default(name, path):
        error = SchemaError(
            f"state '{name}' can be entered without a transition, but plot '{need.plot}' needs '{need.parameter}'",
            place=plot.place(path),
        )
        yield Finding(error, "parameters are given", f"add `{need.parameter}: …` under its `with`")
    for way in silent:
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
