"""Checks of arguments for plots and components: names exist, values are in range, required values are present."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from dsc.dynamic.steps import Step, concerns, contents_of, entered_by, is_open
from dsc.errors import Finding
from dsc.model.actions import Assign, Bind, ExternalAction, Internal, flat
from dsc.model.declarations import PlotParameter
from dsc.model.plot import ActionPlot, Path, initial_of
from dsc.model.ranges import Who, refuse_change
from dsc.model.rules import Rule
from dsc.model.states import AnyState, FinalState, HistoryState, State, SubmachineState
from dsc.model.transitions import Transition, TransitionSource
from dsc.validation.subject import ALLOW, Subject
from knowledge_base.errors import InputError, SchemaError
from knowledge_base.language.syntax.expression import Constant, Term

# -- values and roles ----------------------------------------------------------------------------------------


def check_parameters(subject: Subject) -> Iterator[Finding]:
    """Yield findings about the declarations of a plot's parameters, and about its arguments for other plots."""
    plot, library = subject.plot, subject.library
    for name, parameter in plot.parameters.items():
        yield from _own(subject, name, parameter)
    for name, state, path in subject.states:
        if isinstance(state, Step) and state.arguments:
            yield from _check_handed(subject, subject.contents(name), state.arguments, "plots", (*path, "with"))
        for here, _, way in subject.leaving(path):
            if way.passed:
                yield from _check_handed(subject, subject.contents(way.target), way.passed, "plots", (*here, "pass"))
    for path, do in subject.reactions():
        if do.use is not None:
            yield from _check_handed(subject, [library.plot(do.use)], do.arguments, "rules", (*path, "with"))
    for number, rule in enumerate(plot.rules):
        entered = entered_by(rule, plot, library) if rule.do.passed else ()
        yield from _check_handed(subject, entered, rule.do.passed, "rules", ("rules", number, "do", "pass"))


def _own(subject: Subject, name: str, parameter: PlotParameter) -> Iterator[Finding]:
    here: Path = ("parameters", name)
    for problem in parameter.range.problems():
        yield subject.finding(here, "parameter-roles", f"parameter '{name}': {problem}")
        return
    if parameter.required:
        if parameter.changed_by != "plots":
            message = f"'{name}' needs a default, because not every user of the plot may set it"
            yield subject.finding(here, "parameter-roles", message, "a profile may set another one")
    elif isinstance(parameter.default, Constant) and parameter.bounded:
        yield from _fits(subject, f"{subject.plot.name}.{name}", parameter, parameter.default, (*here, "default"))


def _check_handed(
    subject: Subject, used: Iterable[ActionPlot], arguments: Mapping[str, Term], who: Who, path: Path
) -> Iterator[Finding]:
    for plot in used:
        for name, term in arguments.items():
            parameter, full, here = plot.parameters.get(name), f"{plot.name}.{name}", (*path, name)
            if parameter is None:  # another candidate has the parameter, or another check reports it
                continue
            try:
                refuse_change(full, who, parameter.changed_by)
            except SchemaError as refused:
                yield subject.caught(refused, here, "parameter-roles", ALLOW)
                continue
            if isinstance(term, Constant) and parameter.bounded:
                yield from _fits(subject, full, parameter, term, here)


def _fits(subject: Subject, name: str, parameter: PlotParameter, term: Constant, path: Path) -> Iterator[Finding]:
    try:
        parameter.range.check(name, term.value)
    except InputError as error:
        yield subject.caught(error, path, "parameter-roles")


def check_outputs(subject: Subject) -> Iterator[Finding]:
    """Yield findings about outputs to which the plot assigns no value."""
    open_ones = [name for name, output in subject.plot.outputs.items() if output.initial is None]
    if not open_ones:
        return
    actions = flat(action for _, state, _ in subject.states for action in _actions(state))
    assigned = {name for action in actions if isinstance(action, Assign | Bind) for name in _variables(action)}
    for name in open_ones:
        if name not in assigned:
            fix = "`assign` it on the way to the end, or add `initial`"
            message = f"the output '{name}' never gets a value"
            yield subject.finding(("outputs", name), "outputs-are-given", message, fix)


def _variables(action: Assign | Bind) -> Iterable[str]:
    return action.assign if isinstance(action, Assign) else action.names


def _actions(state: AnyState) -> Iterator[ExternalAction | Internal]:
    if isinstance(state, State):
        for _, actions in state.blocks():
            yield from actions
    if isinstance(state, TransitionSource):
        for _, transition in state.transitions():
            yield from transition.effect
    else:
        yield from state.entry if isinstance(state, FinalState) else state.do


# -- names ---------------------------------------------------------------------------------------------------


def check_arguments(subject: Subject) -> Iterator[Finding]:
    """Yield findings about the arguments that the plot passes to other plots."""
    entrances = _Entrances(subject)
    for name, state, path in subject.states:
        if isinstance(state, Step):
            yield from _check_known(subject, state, state.arguments, (*path, "with"))
            for used in subject.contents(name):
                for parameter in _find_needed(used):
                    if parameter not in state.arguments:
                        yield from _check_given(subject, name, path, _Need(used.name, parameter), entrances)
        for here, _, transition in subject.leaving(path):
            if transition.passed:
                yield from _check_passed(subject, transition, (*here, "pass"))
    for path, do in subject.reactions():
        if do.use is not None:
            used, here = subject.library.plot(do.use), (*path, "with")
            yield from _unknown(subject, used, do.arguments, here)
            missing = (name for name in _find_needed(used) if name not in do.arguments)
            yield from (_missing(subject, _Need(used.name, name), here) for name in missing)
    for number, rule in enumerate(subject.plot.rules):
        if rule.do.passed:
            yield from _passed_by_rule(subject, rule, ("rules", number, "do", "pass"))


def _passed_by_rule(subject: Subject, rule: Rule, path: Path) -> Iterator[Finding]:
    """Yield a finding for each passed argument that is a parameter of none of the rule's steps."""
    library, to_state = subject.library, rule.then in subject.names
    used: list[ActionPlot] = []
    for name, state, _ in subject.steps:
        if name == rule.then if to_state else concerns(rule, name, state, library):
            used += contents_of(state, library)
    if not to_state:  # steps of plans
        used += [one for one in library if one.implements and (not rule.steps or one.implements in rule.steps)]
    message = "no plot that is entered then has a parameter '{}'"
    yield from _untaken(subject, used, rule.do.passed, path, "known-parameter", message)


def _check_passed(subject: Subject, transition: Transition, path: Path) -> Iterator[Finding]:
    target = None if transition.target is None else subject.state(transition.target)
    if isinstance(target, Step):
        yield from _check_known(subject, target, transition.passed, path)
        return
    where = "nowhere" if transition.target is None else f"to '{transition.target}', which holds no plot"
    message, fix = (
        f"arguments are passed by a transition that leads {where}",
        "pass them to a state with `use` or `dynamic`",
    )
    yield subject.finding(path, "arguments-are-taken", message, fix)


def _check_known(subject: Subject, state: Step, given: Iterable[str], path: Path) -> Iterator[Finding]:
    contents = contents_of(state, subject.library)
    if isinstance(state, SubmachineState):
        for used in contents:
            yield from _unknown(subject, used, given, path)
    elif not is_open(state, subject.library):  # a candidate that arrives later may have the parameter
        message = "no candidate has a parameter '{}'"
        yield from _untaken(subject, contents, given, path, "candidates-conform", message)


def _unknown(subject: Subject, used: ActionPlot, given: Iterable[str], path: Path) -> Iterator[Finding]:
    message = f"plot '{used.name}' has no parameter '{{}}'"
    yield from _untaken(subject, [used], given, path, "known-parameter", message)


def _untaken(
    subject: Subject, used: Iterable[ActionPlot], given: Iterable[str], path: Path, rule: str, message: str
) -> Iterator[Finding]:
    """Yield a finding for each argument that is a parameter of none of the plots; `message` formats its name."""
    taken = {name for plot in used for name in plot.parameters}
    for name in sorted(set(given) - taken):
        yield subject.finding((*path, name), rule, message.format(name), found=name, valid=taken)


# -- required arguments --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Need:
    """A required parameter, and the plot that declares the parameter."""

    plot: str
    parameter: str


def _find_needed(plot: ActionPlot) -> Iterator[str]:
    return (name for name, parameter in plot.parameters.items() if parameter.required)


class _Entrances:
    """Transitions by target state, collected on first use, because in most plots `with` sets every parameter."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject

    @cached_property
    def ways(self) -> Mapping[str, list[tuple[Transition, Path | None]]]:
        """Transitions of the expanded plot, with paths, by target state; a rule's transition has the path `None`."""
        subject = self._subject
        try:
            expanded = subject.library.expanded(subject.plot)
        except InputError:  # the check of wiring reports the error
            expanded = subject.plot
        found: defaultdict[str, list[tuple[Transition, Path | None]]] = defaultdict(list)
        for name, state, path in expanded.walk():
            for inside, _, transition in state.placed_transitions() if isinstance(state, TransitionSource) else ():
                written = name in subject.names and transition.rule is None
                for target in transition.targets:
                    found[target].append((transition, (*path, *inside) if written else None))
        return found

    def by_default(self, name: str, path: Path) -> bool:
        """Return whether a state is the initial state of its scope, or a history may restore the state."""
        return name in self._defaults or any(path[:length] in self._remembered for length in range(len(path)))

    @cached_property
    def _defaults(self) -> set[str]:
        histories = {state.target for _, state, _ in self._subject.states if isinstance(state, HistoryState)}
        return histories | {initial_of(scope) for scope in self._subject.plot.scopes()}

    @cached_property
    def _remembered(self) -> set[Path]:
        return {path[:-2] for _, state, path in self._subject.states if isinstance(state, HistoryState)}


def _check_given(subject: Subject, name: str, path: Path, need: _Need, entrances: _Entrances) -> Iterator[Finding]:
    """Yield a finding for each entry into a state that does not pass the required parameter in `need`."""
    leading, key = entrances.ways.get(name, []), need.parameter
    silent = [(way, written) for way, written in leading if way.target != name or key not in way.passed]
    if len(silent) == len(leading):
        yield _missing(subject, need, (*path, "with"))
        return
    if entrances.by_default(name, path):
        message = f"state '{name}' can be entered without a transition, but plot '{need.plot}' needs '{key}'"
        yield subject.finding(path, "parameters-are-given", message, f"add `{key}: …` under its `with`")
    for way, written in silent:
        by = "a transition" if written else f"the rule '{way.rule}'" if way.rule else "a rule's recovery"
        message = f"{by} leads to '{name}' and does not pass '{key}', which plot '{need.plot}' needs"
        fix = f"add `{key}: …` under {'its `pass`' if written else '`with`'}"
        yield subject.finding(written or path, "parameters-are-given", message, fix)


def _missing(subject: Subject, need: _Need, path: Path) -> Finding:
    message = f"plot '{need.plot}' needs its parameter '{need.parameter}'"
    return subject.finding(path, "parameters-are-given", message, f"add `{need.parameter}: …` under `with`")
