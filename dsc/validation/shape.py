"""Shape of a plot: names, targets, borders, histories, dialect, times and size."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, answerable
from dsc.engine.situation import asked_states
from dsc.engine.tables import compile_plot
from dsc.errors import Finding
from dsc.model.actions import Block, Choose, Emit, ExternalAction, Internal, Log, Withdraw, flat
from dsc.model.plot import ActionPlot, Path
from dsc.model.rules import Rule
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    HistoryState,
    OrthogonalState,
    Region,
    State,
    SubmachineState,
)
from dsc.model.transitions import Transition, TransitionSource
from dsc.validation.nesting import Nesting
from dsc.validation.reach import check_connectors
from dsc.validation.rules import check_rules, unknown_plot
from knowledge_base.errors import SchemaError, UnknownNameError
from knowledge_base.language.syntax.expression import Constant, Term

MAX_ANSWERS = 1_000
"""Upper bound of transitions from rules; ten times those of this project's largest plot, in a tenth of a second."""


def check_size(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Yield a finding if the expansion of the plot's rules would take too long."""
    if not plot.rules and not plot.handlers:
        return
    answered = Counter(event for _, state, _ in nesting.states for event in answerable(state, library))
    steps = sum(isinstance(state, Step) for _, state, _ in nesting.states)
    made = sum(_answers(rule, answered[rule.on] if rule.on is not None else steps, nesting) for rule in plot.rules)
    made += sum(bool(rule.before) for rule in plot.rules) * _passing(nesting)  # each needs a separate transition
    made += sum(handler.interrupt for handler in plot.handlers) * len(nesting.states)
    if made > MAX_ANSWERS:
        what = "rules and handlers" if plot.rules and plot.handlers else "rules" if plot.rules else "handlers"
        message = f"the {what} would make {made} transitions; at most {MAX_ANSWERS} are made"
        error = SchemaError(message, place=plot.place(("rules",) if plot.rules else ("handlers",)))
        yield Finding(error, "bounded rules", "say with `of` for which states a rule is")


def _passing(nesting: Nesting) -> int:
    """Return the number of transitions that pass arguments."""
    return sum(bool(way.passed) for _, _, path in nesting.states for _, _, way in nesting.leaving(path))


def _answers(rule: Rule, at_most: int, nesting: Nesting) -> int:
    """Return an upper bound of the number of states that a rule answers for, without a look at each state."""
    by_state = rule.steps and all(name in nesting.names for name in rule.steps)
    return min(at_most, len(rule.steps)) if by_state else at_most


def check_timing(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about timeouts before the state's least time has passed."""
    for name, state, path in nesting.states:
        least = _seconds(state.at_least) if isinstance(state, State) else None
        if not isinstance(state, State) or least is None:
            continue
        for number, timed in enumerate(state.after):
            after = _seconds(timed.seconds)
            if after is not None and after < least:
                error = SchemaError(
                    f"state '{name}' lasts at least {least:g} s, so its timeout cannot be taken after {after:g} s",
                    place=plot.place((*path, "after", number, "seconds")),
                )
                yield Finding(error, "at least", f"let it be {least:g} s or more")


def _seconds(term: Term | None) -> float | None:
    """Return the seconds of a constant."""
    return float(term.value) if isinstance(term, Constant) else None


def check_history(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about histories and about transitions that clear them."""
    memory = _Memory(nesting)
    for _, state, path in nesting.states:
        if isinstance(state, HistoryState):
            yield from _default(plot, state, path, nesting)
        elif plot.dialect == "scxml":
            for inside, _, transition in nesting.leaving(path):
                yield from _cleared(plot, transition, (*path, *inside, "clear"), memory)


def _default(plot: ActionPlot, state: HistoryState, path: Path, nesting: Nesting) -> Iterator[Finding]:
    """Require that a history's target is inside the state that the history belongs to (SCXML 3.10)."""
    around = path[:-2]
    if not nesting.inside(state.target, around):
        error = UnknownNameError(
            f"there is no state '{state.target}' in the scope of the history", place=plot.place((*path, "to")),
            found=state.target, valid=nesting.within(around),
        )  # fmt: skip
        yield Finding(error, "target")


class _Memory:
    """States with histories inside, collected once.

    Attributes:
        holders: name -> path of the composite and orthogonal states.
        directly: paths of the states whose histories are directly inside, or in one of their regions.
        below: paths of the states with histories at any level.
    """

    def __init__(self, nesting: Nesting) -> None:
        self.holders: dict[str, Path] = {}
        self.directly: set[Path] = set()
        self.below: set[Path] = set()
        for name, state, path in nesting.states:
            if isinstance(state, CompositeState | OrthogonalState):
                self.holders[name] = path
            elif isinstance(state, HistoryState):
                around = list(nesting.way(path))[:-1]
                self.directly.update(around[-1:])
                self.below.update(around)


def _cleared(plot: ActionPlot, transition: Transition, path: Path, memory: _Memory) -> Iterator[Finding]:
    """Require a history for Harel's clear-history: directly inside the state, or with `*` at any level below."""
    for number, written in enumerate(transition.clear):
        name, place = written.removesuffix("*"), plot.place((*path, number))
        remembering = memory.below if written.endswith("*") else memory.directly
        if name not in memory.holders:
            error = UnknownNameError(
                f"there is no composite or orthogonal state '{name}' with a history to clear",
                place=place, found=name, valid=memory.holders,
            )  # fmt: skip
            yield Finding(error, "clear")
        elif memory.holders[name] not in remembering:
            nothing = SchemaError(f"the state '{name}' has no history to clear", place=place, found=name)
            yield Finding(nothing, "clear", f'write "{name}*" to clear those of the levels below it')


FIX = "write `dialect: scxml` if the plot is to be an SCXML chart"


def check_dialect(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about features outside the plot's dialect."""
    if plot.dialect == "scxml":
        return
    for name, state, path in nesting.states:
        if isinstance(state, HistoryState):
            yield _finding(plot, f"'{name}' is a history state", path)
        elif isinstance(state, FinalState):
            yield from _inside(plot, name, state.entry, (*path, "entry"))
        else:
            yield from _source(plot, name, state, path, nesting)


def _source(plot: ActionPlot, name: str, source: TransitionSource, path: Path, nesting: Nesting) -> Iterator[Finding]:
    if isinstance(source, OrthogonalState) and source.connectors:
        yield _finding(plot, f"'{name}' has connectors", (*path, "connectors"))
    if isinstance(source, State):
        for key, actions in source.blocks():
            if actions:
                yield from _inside(plot, name, actions, (*path, key))
    for inside, _, transition in nesting.leaving(path):
        yield from _transition(plot, name, transition, (*path, *inside))


def _inside(plot: ActionPlot, name: str, actions: Iterable[ExternalAction | Internal], path: Path) -> Iterator[Finding]:
    if any(isinstance(action, Internal) for action in actions):
        yield _finding(plot, f"'{name}' has an internal action outside its transitions", path)


def _transition(plot: ActionPlot, name: str, transition: Transition, path: Path) -> Iterator[Finding]:
    if transition.also or transition.internal:
        yield _finding(plot, f"a transition of '{name}' is internal or has several targets", path)
    if transition.clear:
        yield _finding(plot, f"a transition of '{name}' clears histories", (*path, "clear"))
    if transition.guard is not None and asked_states(transition.guard):
        yield _finding(plot, f"a guard of '{name}' asks which states are active", (*path, "when"))
    if transition.do and any(_is_foreign(action) for action in flat(transition.do)):
        yield _finding(plot, f"a transition of '{name}' branches, logs or sends with a delay", path)


def _is_foreign(action: ExternalAction | Internal) -> bool:
    sent = isinstance(action, Emit) and (action.delay, action.id, action.into) != (None, None, None)
    return sent or isinstance(action, Block | Choose | Log | Withdraw)


def _finding(plot: ActionPlot, what: str, path: Path) -> Finding:
    return Finding(SchemaError(f"{what}, which only dialect scxml has", place=plot.place(path)), "dialect", FIX)


def check_structure(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about the plot's states and targets, before checks of their behaviour."""
    sound = True
    for finding in _shape(plot, library, nesting):
        sound = False
        yield finding
    if sound and plot.dialect == "scxml":
        yield from _tables(plot)


def _shape(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    yield from check_dialect(plot, nesting)
    yield from check_connectors(plot, nesting)
    yield from check_history(plot, nesting)
    yield from check_timing(plot, nesting)
    yield from _scope(plot, plot, (), nesting)
    for name, state, path in nesting.states:
        if isinstance(state, CompositeState):
            yield from _scope(plot, state, path, nesting)
        if isinstance(state, OrthogonalState):
            for key, region in state.regions.items():
                yield from _scope(plot, region, (*path, "regions", key), nesting)
        yield from _uses(plot, state, path, library)
        if plot.dialect == "dsc":
            yield from _dead_end(plot, name, state, path, nesting)
    yield from check_rules(plot, library, nesting)


def _tables(plot: ActionPlot) -> Iterator[Finding]:
    """Yield errors that the chart compiler finds once all targets are known."""
    try:
        compile_plot(plot)
    except SchemaError as error:
        error.place = next((plot.place(path) for name, _, path in plot.walk() if name == error.found), None)
        yield Finding(error, "target")


def _scope(
    plot: ActionPlot, scope: ActionPlot | CompositeState | Region, path: Path, nesting: Nesting
) -> Iterator[Finding]:
    first, anywhere_inside = scope.initial, plot.dialect == "scxml"
    if first is not None and not (nesting.inside(first, path) if anywhere_inside else first in scope.states):
        error = UnknownNameError(
            f"there is no state '{first}' to begin with", place=plot.place((*path, "initial")),
            found=first, valid=nesting.within(path) if anywhere_inside else scope.states,
        )  # fmt: skip
        yield Finding(error, "initial")
    for name in scope.states:
        yield from _targets(plot, (*path, "states", name), scope.states, nesting)


def _targets(plot: ActionPlot, path: Path, siblings: Mapping[str, AnyState], nesting: Nesting) -> Iterator[Finding]:
    for inside, _, transition in nesting.leaving(path):
        for target in transition.targets:
            if target not in siblings:
                yield from _elsewhere(plot, target, siblings, nesting.names, (*path, *inside, "to"))


def _elsewhere(
    plot: ActionPlot, target: str, siblings: Mapping[str, AnyState], everywhere: Collection[str], path: Path
) -> Iterator[Finding]:
    """Yield findings about a target outside the scope of its source."""
    if target not in everywhere:
        missing = UnknownNameError(
            f"there is no state '{target}'", place=plot.place(path), found=target,
            valid=siblings if plot.dialect == "dsc" else everywhere,
        )  # fmt: skip
        yield Finding(missing, "target")
    elif plot.dialect == "dsc":
        error = SchemaError(f"the transition to '{target}' crosses a border", place=plot.place(path), found=target)
        yield Finding(error, "no border crossing", "transitions stay in the state, region or plot around")


def _uses(plot: ActionPlot, state: AnyState, path: Path, library: Library) -> Iterator[Finding]:
    if isinstance(state, SubmachineState) and state.use.startswith("?"):
        if state.use[1:] not in plot.variables and state.use[1:] not in plot.parameters:
            valid = {f"?{name}" for name in (*plot.variables, *plot.parameters)}
            error = UnknownNameError(
                f"there is no variable '{state.use}'", place=plot.place((*path, "use")), found=state.use, valid=valid
            )
            yield Finding(error, "known plot")
    elif isinstance(state, SubmachineState) and state.use not in library:
        yield unknown_plot(plot, (*path, "use"), state.use, library)
    elif isinstance(state, DynamicState):
        for number, name in enumerate(state.dynamic):
            if name not in library:
                yield unknown_plot(plot, (*path, "dynamic", number), name, library)


def _dead_end(plot: ActionPlot, name: str, state: AnyState, path: Path, nesting: Nesting) -> Iterator[Finding]:
    if isinstance(state, State) and not any(map(nesting.leaving, nesting.way(path))):
        error = SchemaError(f"no transition leaves the state '{name}'", place=plot.place(path))
        yield Finding(error, "no dead end", "wire what it ends with, or make it `final: true`")
