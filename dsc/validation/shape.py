"""Checks of structure: names, targets, borders, histories, dialect, times and size of a plot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from dsc.dynamic.steps import answerable, candidates_of
from dsc.engine.tables import compile_plot
from dsc.errors import Finding
from dsc.model.actions import (
    Block,
    Choose,
    Emit,
    ExternalAction,
    Internal,
    Log,
    Withdraw,
    flat,
)
from dsc.model.plot import Path, Scope
from dsc.model.rules import Rule
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
from dsc.model.transitions import Transition
from dsc.validation.reach import check_connectors
from dsc.validation.robot import check_robot, sets_motors
from dsc.validation.rules import check_rules
from dsc.validation.subject import Subject
from knowledge_base.errors import SchemaError
from knowledge_base.language.syntax.expression import Constant, Term

MAX_ANSWERS = 1_000
"""Upper bound of the transitions that the expansion of rules adds to a plot.

This is ten times the number in this project's largest plot. Their expansion takes a tenth of a second.
"""


def check_structure(subject: Subject) -> Iterator[Finding]:
    """Yield findings about the plot's states and targets; checks of behaviour require a plot without such findings."""
    sound = True
    for finding in _shape(subject):
        sound = False
        yield finding
    if sound and not subject.strict:
        yield from _tables(subject)


def _shape(subject: Subject) -> Iterator[Finding]:
    if subject.strict:
        yield from _dialect(subject)
    yield from check_connectors(subject)
    yield from _histories(subject)
    yield from _timing(subject)
    yield from _scope(subject, subject.plot, ())
    for name, state, path in subject.states:
        if isinstance(state, CompositeState):
            yield from _scope(subject, state, path)
        if isinstance(state, OrthogonalState):
            for key, region in state.regions.items():
                yield from _scope(subject, region, (*path, "regions", key))
        yield from _uses(subject, state, path)
        # A state with content may work without end; otherwise its completion has a transition.
        if subject.strict and type(state) is State and not any(map(subject.leaving, subject.way_to(path))):
            fix = "wire its outcomes, or make it `final: true`"
            yield subject.finding(path, "no-dead-end", f"no transition leaves the state '{name}'", fix)
    yield from check_robot(subject)
    yield from check_rules(subject)


def _tables(subject: Subject) -> Iterator[Finding]:
    """Yield errors of the chart compiler, which require that all targets exist."""
    try:
        compile_plot(subject.plot)
    except SchemaError as error:
        yield subject.caught(error, subject.names.get(error.found or "", ()), "target")


# -- targets -------------------------------------------------------------------------------------------------


def _scope(subject: Subject, scope: Scope, path: Path) -> Iterator[Finding]:
    first, valid = scope.initial, scope.states.keys()
    if first is not None and not (first in valid if subject.strict else subject.inside(first, path)):
        yield subject.finding(
            (*path, "initial"), "initial", f"there is no state '{first}' to begin with",
            found=first, valid=valid if subject.strict else subject.within(path),
        )  # fmt: skip
    for name in scope.states:
        for here, _, transition in subject.leaving((*path, "states", name)):
            for target in transition.targets:
                if target not in scope.states:
                    yield from _elsewhere(subject, target, scope.states, (*here, "to"))


def _elsewhere(subject: Subject, target: str, siblings: Mapping[str, AnyState], path: Path) -> Iterator[Finding]:
    """Yield findings about a target outside the scope of its source."""
    if target not in subject.names:
        valid = siblings if subject.strict else subject.names
        yield subject.finding(path, "target", f"there is no state '{target}'", found=target, valid=valid)
    elif subject.strict:
        message = f"the transition to '{target}' crosses a border"
        fix = "transitions stay in the state, region or plot around"
        yield subject.finding(path, "no-border-crossing", message, fix, found=target)


def _uses(subject: Subject, state: AnyState, path: Path) -> Iterator[Finding]:
    plot, library = subject.plot, subject.library
    if isinstance(state, SubmachineState) and state.use.startswith("?"):
        held = {f"?{name}" for name in (*plot.variables, *plot.parameters)}
        if state.use not in held:
            message = f"there is no variable '{state.use}'"
            yield subject.finding((*path, "use"), "known-plot", message, found=state.use, valid=held)
    elif isinstance(state, SubmachineState) and state.use not in library:
        yield subject.unknown_plot((*path, "use"), state.use)
    elif isinstance(state, DynamicState):
        for number, name in enumerate(state.candidates):
            if name not in library:
                yield _missing_candidate(subject, state, (*path, "dynamic", number), name)


def _missing_candidate(subject: Subject, state: DynamicState, path: Path, name: str) -> Finding:
    """Return the finding about a listed candidate that is not installed: an error only if it leaves no candidate."""
    finding = subject.unknown_plot(path, name)
    return replace(finding, level="warning") if candidates_of(state, subject.library) else finding


def _histories(subject: Subject) -> Iterator[Finding]:
    """Yield findings about histories: targets must be inside the parent (SCXML 3.10), and `clear` needs a history."""
    remembering: dict[bool, set[Path]] = {False: set(), True: set()}  # `True`: with a history at any level
    for _, state, path in subject.states:
        if isinstance(state, HistoryState):
            around = list(subject.way_to(path))[:-1]
            remembering[False].update(around[-1:])
            remembering[True].update(around)
    for _, state, path in subject.states:
        if isinstance(state, HistoryState) and not subject.inside(state.target, path[:-2]):
            message = f"there is no state '{state.target}' in the scope of the history"
            valid = subject.within(path[:-2])
            yield subject.finding((*path, "to"), "target", message, found=state.target, valid=valid)
        for here, _, transition in () if subject.strict else subject.leaving(path):
            for number, written in enumerate(transition.clear):
                yield from _check_clear(subject, written, remembering, (*here, "clear", number))


def _check_clear(
    subject: Subject, written: str, remembering: Mapping[bool, set[Path]], path: Path
) -> Iterator[Finding]:
    """Yield a finding if `clear` refers to a state without history: directly inside, or with `*` at any level."""
    name = written.removesuffix("*")
    holders = {name: at for name, state, at in subject.states if isinstance(state, CompositeState | OrthogonalState)}
    if name not in holders:
        message = f"there is no composite or orthogonal state '{name}' with a history to clear"
        yield subject.finding(path, "clear", message, found=name, valid=holders)
    elif holders[name] not in remembering[written.endswith("*")]:
        fix = f'write "{name}*" to clear those of the levels below it'
        yield subject.finding(path, "clear", f"the state '{name}' has no history to clear", fix, found=name)


# -- times and size ------------------------------------------------------------------------------------------


def _timing(subject: Subject) -> Iterator[Finding]:
    """Yield findings about timeouts that expire before the state's least time has passed."""
    for name, state, path in subject.states:
        least = _seconds(state.at_least) if isinstance(state, State) else None
        for number, timed in enumerate(state.after) if isinstance(state, State) and least is not None else ():
            after = _seconds(timed.seconds)
            if least is not None and after is not None and after < least:
                message = f"state '{name}' lasts at least {least:g} s, so its timeout cannot be taken after {after:g} s"
                here = (*path, "after", number, "seconds")
                yield subject.finding(here, "at-least", message, f"let it be {least:g} s or more")


def _seconds(term: Term | None) -> float | None:
    """Return the value of a constant in seconds; `None` for any other term."""
    return float(term.value) if isinstance(term, Constant) else None


def check_size(subject: Subject) -> Iterator[Finding]:
    """Yield a finding if the expansion of the plot's rules would exceed `MAX_ANSWERS` transitions."""
    plot = subject.plot
    if not plot.rules and not plot.handlers:
        return
    answered = Counter(event for _, state, _ in subject.states for event in answerable(state, subject.library))
    passing = sum(bool(way.passed) for _, _, way in subject.ways())
    made = sum(_answers(rule, answered, subject) for rule in plot.rules)
    made += sum(bool(rule.before) for rule in plot.rules) * passing  # one for each `before` rule
    made += sum(handler.interrupt for handler in plot.handlers) * len(subject.states)
    if made > MAX_ANSWERS:
        what = "rules and handlers" if plot.rules and plot.handlers else "rules" if plot.rules else "handlers"
        message = f"the {what} would make {made} transitions; at most {MAX_ANSWERS} are made"
        here = ("rules",) if plot.rules else ("handlers",)
        yield subject.finding(here, "bounded-rules", message, "name the states of a rule with `of`")


def _answers(rule: Rule, answered: Mapping[str, int], subject: Subject) -> int:
    """Return an upper bound of the number of states to which a rule applies, without a check of each state."""
    at_most = len(subject.steps) if rule.on is None else answered.get(rule.on, 0)
    by_state = rule.steps and all(name in subject.names for name in rule.steps)
    return min(at_most, len(rule.steps)) if by_state else at_most


# -- dialect -------------------------------------------------------------------------------------------------


def _dialect(subject: Subject) -> Iterator[Finding]:
    """Yield findings about features that exist only in dialect `scxml`."""
    for path, what in _foreign(subject):
        fix = "write `dialect: scxml` if the plot is to be an SCXML chart"
        if path[-1] in _BLOCKS and path[-2] != "states":
            move = "move it" if subject.plot.robot is None else "assign only motors here; move the rest"
            fix = f"{move} to a transition, e.g. under `do`, or {fix}"
        yield subject.finding(path, "dialect", f"{what}, which only dialect scxml has", fix)


_BLOCKS = frozenset({"entry", "exit", "on_break"})


def _foreign(subject: Subject) -> Iterator[tuple[Path, str]]:
    for name, state, path in subject.states:
        if isinstance(state, HistoryState):
            yield path, f"'{name}' is a history state"
        elif isinstance(state, OrthogonalState) and state.connectors:
            yield (*path, "connectors"), f"'{name}' has connectors"
        for key, actions in _blocks(state):
            if any(isinstance(action, Internal) and not sets_motors(subject, action) for action in actions):
                yield (*path, key), f"'{name}' has an internal action outside its transitions"
        for here, _, transition in subject.leaving(path):
            yield from ((here + more, what) for more, what in _foreign_in(transition, name))


def _blocks(state: AnyState) -> Iterable[tuple[str, tuple[ExternalAction | Internal, ...]]]:
    if isinstance(state, State):
        return state.blocks()
    return [("entry", state.entry)] if isinstance(state, FinalState) else []


def _foreign_in(transition: Transition, name: str) -> Iterator[tuple[Path, str]]:
    if transition.also or transition.internal:
        yield (), f"a transition of '{name}' is internal or has several targets"
    if transition.clear:
        yield ("clear",), f"a transition of '{name}' clears histories"
    if transition.do and any(map(_is_foreign, flat(transition.do))):
        yield (), f"a transition of '{name}' branches, logs or sends with a delay"


def _is_foreign(action: ExternalAction | Internal) -> bool:
    match action:
        case Emit(delay=delay, id=sent, into=into):
            return (delay, sent, into) != (None, None, None)
        case Block() | Choose() | Log() | Withdraw():
            return True
        case _:
            return False
