"""Arguments, parameters and outputs of plots: names exist, values are in range, and no required value is missing."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, concerns, contents_of, entered_by
from dsc.errors import Finding
from dsc.model.actions import Assign, ExternalAction, Internal, flat
from dsc.model.plot import ActionPlot, Path, PlotParameter, initial_of
from dsc.model.ranges import Who, refuse_change
from dsc.model.rules import Reaction, Rule
from dsc.model.states import AnyState, FinalState, HistoryState, State, SubmachineState
from dsc.model.transitions import Transition, TransitionSource
from dsc.validation.nesting import Nesting
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.syntax.expression import Constant, Term


def check_parameters(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about the roles of a plot's own parameters, and about its arguments for other plots."""
    for name, parameter in plot.parameters.items():
        yield from _own(plot, name, parameter)
    for _, state, path in nesting.states:
        if isinstance(state, Step) and state.arguments:
            for used in contents_of(state, library):
                yield from _handed(plot, used, state.arguments, "plots", (*path, "with"))
        for inside, _, way in nesting.leaving(path):
            target = nesting.state(way.target) if way.passed and way.target is not None else None
            for used in contents_of(target, library) if isinstance(target, Step) else ():
                yield from _handed(plot, used, way.passed, "plots", (*path, *inside, "pass"))
    yield from _by_rules(plot, library)


def _by_rules(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    for group, reactions in (("rules", [r.do for r in plot.rules]), ("handlers", [h.do for h in plot.handlers])):
        for number, do in enumerate(reactions):
            if do.use is not None:
                yield from _handed(plot, library.plot(do.use), do.arguments, "rules", (group, number, "do", "with"))
    for number, rule in enumerate(plot.rules):
        for one in entered_by(rule, plot, library) if rule.do.passed else ():
            yield from _handed(plot, one, rule.do.passed, "rules", ("rules", number, "do", "pass"))


def _own(plot: ActionPlot, name: str, parameter: PlotParameter) -> Iterator[Finding]:
    here: Path = ("parameters", name)
    for problem in parameter.range.problems():
        yield Finding(SchemaError(f"parameter '{name}': {problem}", place=plot.place(here)), "parameter roles")
        return
    if parameter.default is None:
        if parameter.changed_by != "plots":
            message = f"'{name}' needs a default, because not every user of the plot may set it"
            error = SchemaError(message, place=plot.place(here))
            yield Finding(error, "parameter roles", "a profile may say another one")
    elif isinstance(parameter.default, Constant) and parameter.bounded:
        yield from _fits(plot, f"{plot.name}.{name}", parameter, parameter.default, (*here, "default"))


def _handed(
    plot: ActionPlot, used: ActionPlot, arguments: Mapping[str, Term], who: Who, path: Path
) -> Iterator[Finding]:
    for name, term in arguments.items():
        parameter = used.parameters.get(name)
        if parameter is None:  # another candidate's parameter, or a separate finding
            continue
        full, here = f"{used.name}.{name}", (*path, name)
        try:
            refuse_change(full, who, parameter.changed_by)
        except SchemaError as refused:
            refused.place = plot.place(here)
            yield Finding(refused, "parameter roles", "say it in a profile, or let `changed_by` allow it")
            continue
        if isinstance(term, Constant) and parameter.bounded:
            yield from _fits(plot, full, parameter, term, here)


def _fits(plot: ActionPlot, name: str, parameter: PlotParameter, term: Constant, path: Path) -> Iterator[Finding]:
    try:
        parameter.range.check(name, term.value)
    except InputError as error:
        error.place = plot.place(path)
        yield Finding(error, "parameter roles")


def check_outputs(plot: ActionPlot) -> Iterator[Finding]:
    """Yield findings about outputs without an assignment."""
    open_ones = [name for name, output in plot.outputs.items() if output.initial is None]
    if not open_ones:
        return
    assigned = {name for _, state, _ in plot.walk() for name in _assigned(_actions(state))}
    for name in open_ones:
        if name not in assigned:
            error = SchemaError(f"the output '{name}' never gets a value", place=plot.place(("outputs", name)))
            yield Finding(error, "outputs are given", "`assign` it on the way to the end, or add `initial`")


def _assigned(actions: Iterable[ExternalAction | Internal]) -> Iterator[str]:
    return (name for action in flat(actions) if isinstance(action, Assign) for name in action.assign)


def _actions(state: AnyState) -> Iterator[ExternalAction | Internal]:
    if isinstance(state, State):
        for _, actions in state.blocks():
            yield from actions
    if isinstance(state, TransitionSource):
        for _, transition in state.transitions():
            yield from transition.effect
    else:
        yield from state.entry if isinstance(state, FinalState) else state.do


def check_arguments(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about the arguments of used plots."""
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


def _passed_by_rule(plot: ActionPlot, rule: Rule, path: Path, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Require that some step of the rule takes each passed argument; other steps do not receive it."""
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


# -- required arguments --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Need:
    """A parameter without default, and the plot that has it."""

    plot: str
    parameter: str


@dataclass(frozen=True, slots=True)
class _WayIn:
    """A transition of the expanded plot; `path` is `None` if a rule created it."""

    transition: Transition
    path: Path | None


def _needed(parameters: Mapping[str, PlotParameter]) -> Iterable[str]:
    return (name for name, parameter in parameters.items() if parameter.default is None)


def _needs(state: Step, library: Library) -> Iterator[_Need]:
    """Yield the required parameters that `with` does not set."""
    for used in contents_of(state, library):
        for name in _needed(used.parameters):
            if name not in state.arguments:
                yield _Need(used.name, name)


class _Entrances:
    """Transitions into states, collected on first use: in most plots `with` sets every parameter."""

    def __init__(self, plot: ActionPlot, library: Library, nesting: Nesting) -> None:
        self._plot = plot
        self._library = library
        self._nesting = nesting

    @cached_property
    def ways(self) -> Mapping[str, list[_WayIn]]:
        """State -> the transitions that lead to it."""
        try:
            expanded = self._library.expanded(self._plot)
        except InputError:  # the wiring check reports it
            expanded = self._plot
        found: defaultdict[str, list[_WayIn]] = defaultdict(list)
        for name, state, path in expanded.walk():
            for inside, _, transition in state.placed_transitions() if isinstance(state, TransitionSource) else ():
                written = name in self._nesting.names and transition.rule is None
                way = _WayIn(transition, (*path, *inside) if written else None)
                for target in transition.targets:
                    found[target].append(way)
        return found

    def by_default(self, name: str, path: Path) -> bool:
        """Return whether the state is initial in its scope, or a history may restore it."""
        return name in self._defaults or any(path[:length] in self._remembered for length in range(len(path)))

    @cached_property
    def _defaults(self) -> set[str]:
        histories = {state.target for _, state, _ in self._nesting.states if isinstance(state, HistoryState)}
        return histories | {initial_of(scope) for scope in self._plot.scopes()}

    @cached_property
    def _remembered(self) -> set[Path]:
        return {path[:-2] for _, state, path in self._nesting.states if isinstance(state, HistoryState)}


def _given(plot: ActionPlot, name: str, path: Path, need: _Need, entrances: _Entrances) -> Iterator[Finding]:
    """Require that every transition into the state passes a parameter that `with` does not set."""
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
