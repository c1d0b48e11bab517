"""Flow of events: declared outcomes are wired, wired events can happen, `done` is handled (S2.2, S0.11)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cache

from dsc.dynamic.library import Library
from dsc.dynamic.responses import limit_of
from dsc.dynamic.steps import Step, answerable, answers_in_plans, concerns, outcomes_of
from dsc.errors import Finding
from dsc.events import DONE, EXECUTIVES, NO_CANDIDATE, RESERVED, TIMERS
from dsc.model.actions import Trigger
from dsc.model.plot import ActionPlot, Path, initial_of
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
from dsc.validation.nesting import Nesting
from dsc.validation.reach import circle_of
from dsc.validation.rules import Skills
from knowledge_base.errors import InputError, SchemaError, UnknownNameError


def check_completion(
    plot: ActionPlot, wired: Mapping[str, AnyState], library: Library, nesting: Nesting
) -> Iterator[Finding]:
    """Yield findings about `done`; `wired` has the states of the expanded plot."""
    silent = cache(lambda used: _ends_silently(library.plot(used)))  # many states may use one plot
    for name, state, path in nesting.states:
        if type(state) is State and DONE in state.on and any(isinstance(a, Trigger) for a in state.entry):
            error = SchemaError(
                f"state '{name}' has no content, so it is done immediately and would cancel its skill",
                place=plot.place((*path, "on", DONE)),
            )
            yield Finding(error, "done at once", "wire the outcome of the skill")
        after = wired[name]
        if isinstance(after, State) and DONE not in after.on and _completes(state, silent):
            error = SchemaError(f"state '{name}' does not handle its completion", place=plot.place((*path, "on")))
            yield Finding(error, "completion is wired", "add `done: STATE` under `on`")


def _completes(state: AnyState, silent: Callable[[str], bool]) -> bool:
    if isinstance(state, SubmachineState):
        return state.use.startswith("?") or silent(state.use)
    if isinstance(state, DynamicState):
        return state.goal is not None or any(map(silent, state.dynamic))
    if isinstance(state, CompositeState):
        return any(isinstance(inner, FinalState) for inner in state.states.values())
    return isinstance(state, OrthogonalState)


def _ends_silently(plot: ActionPlot) -> bool:
    """Return whether the plot can reach a top-level final state without firing a declared outcome."""
    waiting = {initial_of(plot)} | {
        target for state in plot.states.values() if isinstance(state, State) for target in _silent_ways(plot, state)
    }
    seen: set[str] = set()
    while waiting:  # follow connectors along transitions without an outcome
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


def check_wiring(plot: ActionPlot, library: Library, skills: Skills, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about events."""
    try:
        expanded = library.expanded(plot)
    except InputError as error:
        yield Finding(error, "rules")
        return
    wired = {name: state for name, state, _ in expanded.walk()}
    traffic = _traffic(plot, library, skills, nesting)
    yield from _declared_events(plot)
    yield from _rule_targets(plot, library)
    yield from _left_out_in_a_circle(plot, expanded)
    for name, state, path in nesting.states:
        if isinstance(state, FinalState):
            yield from _final(plot, state, path)
        if plot.dialect == "dsc":
            yield from _emissions(plot, path, nesting, traffic)
        if not isinstance(state, State):
            continue
        outcomes = outcomes_of(state, library)
        if outcomes or state.entry:  # otherwise the state has no outcome to wire
            handled = _handled([wired[name], *nesting.around(path)])
            yield from _outcomes(plot, name, outcomes, handled, path)
            yield from _skills(plot, name, state, path, handled, skills)
        if plot.dialect == "dsc":  # SCXML allows events without a transition or without a source
            yield from _known_events(plot, state, path, skills, traffic)
    if plot.dialect == "dsc":
        yield from check_completion(plot, wired, library, nesting)


def _declared_events(plot: ActionPlot) -> Iterator[Finding]:
    for event in plot.emits:
        if event in EXECUTIVES:
            yield _reserved(plot, event, ("emits", event))
    for event in plot.receives:
        if event in RESERVED:
            yield _reserved(plot, event, ("receives", event))


def _reserved(plot: ActionPlot, event: str, path: Path) -> Finding:
    error = SchemaError(f"the event '{event}' is fired by the executive itself", place=plot.place(path), found=event)
    return Finding(error, "reserved event", "give yours another name")


def _rule_targets(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    """Require that a rule's target is in the scope of the state that it answers for."""
    leading = [(n, rule) for n, rule in enumerate(plot.rules) if rule.leads_away and not plot.generated]
    for scope in plot.scopes() if leading else ():
        steps = [(name, state) for name, state in scope.states.items() if isinstance(state, Step)]
        for number, rule in leading:
            for name, state in steps if rule.then not in scope.states else ():
                answers = rule.on is None or rule.on in answerable(state, library)
                here = answers and concerns(rule, name, state, library)
                if here or (_is_planned(state) and answers_in_plans(rule, library)):
                    error = SchemaError(
                        f"the rule's way from {'' if here else 'a plan at '}'{name}' to '{rule.then}' crosses a border",
                        place=plot.place(("rules", number, "do", "then")), found=rule.then, valid=scope.states,
                    )  # fmt: skip
                    yield Finding(error, "no border crossing", "say with `of` for which states the rule is")


def _is_planned(state: Step) -> bool:
    return isinstance(state, DynamicState) and state.goal is not None


def _left_out_in_a_circle(plot: ActionPlot, expanded: ActionPlot) -> Iterator[Finding]:
    """Require that in every cycle of steps at least one is never skipped by rules."""
    if not any(rule.before for rule in plot.rules):
        return
    connectors = ((name, state) for name, state, _ in expanded.walk() if isinstance(state, Connector))
    ways = {name: [way.target or "" for _, way in state.transitions()] for name, state in connectors}
    if circle_of(ways):
        error = SchemaError("these rules may skip all steps of a cycle without end", place=plot.place(("rules",)))
        yield Finding(error, "connectors lead on", "let `then` lead to a state where a run can rest")


def _handled(states: Iterable[AnyState]) -> dict[str, bool]:
    """Map each event to whether some transition takes it under all guards."""
    found: dict[str, bool] = {}
    for state in states:
        if isinstance(state, State):
            for event, transitions in state.on.items():
                found[event] = found.get(event, False) or any(t.guard is None for t in transitions)
    return found


def _outcomes(
    plot: ActionPlot, name: str, outcomes: Iterable[str], handled: Mapping[str, bool], path: Path
) -> Iterator[Finding]:
    for event in outcomes:
        if handled.get(event):
            continue
        if event in handled:
            why, fix = _not_always(plot, event)
            message = f"state '{name}' may not handle its outcome '{event}': {why}"
        else:
            message = f"state '{name}' does not handle its outcome '{event}'"
            fix = f"add `{event}: STATE` under `on`, or a rule"
        error = SchemaError(message, place=plot.place((*path, "on", event)))
        yield Finding(error, "every outcome is wired", fix)


def _not_always(plot: ActionPlot, event: str) -> tuple[str, str]:
    """Return the reason why a handled outcome is not always handled, with a remedy."""
    answers = [rule for rule in plot.rules if rule.on == event and rule.when is None and limit_of(rule) is not None]
    if not answers:
        return "every transition has a guard", "add a last transition or rule without `when`"
    often, then = limit_of(answers[-1]), answers[-1].then
    return f"the rule that answers it with '{then}' does so {often} times", f"add a last rule that does not '{then}'"


def _skills(
    plot: ActionPlot, name: str, state: AnyState, path: Path, handled: Mapping[str, bool], skills: Skills
) -> Iterator[Finding]:
    if skills is None or not isinstance(state, State):
        return
    for position, action in enumerate(state.entry):
        if not isinstance(action, Trigger):
            continue
        here = (*path, "entry", position, "trigger")
        signature = skills.get(action.trigger)
        if signature is None:
            error = UnknownNameError(
                f"no component offers the skill '{action.trigger}'",
                place=plot.place(here), found=action.trigger, valid=skills,
            )  # fmt: skip
            yield Finding(error, "known skill")
            continue
        for renamed in action.names:
            if renamed not in signature.outcomes:
                unknown = UnknownNameError(
                    f"skill '{action.trigger}' has no outcome '{renamed}'",
                    place=plot.place((*here[:-1], "as", renamed)), found=renamed, valid=signature.outcomes,
                )  # fmt: skip
                yield Finding(unknown, "known outcome")
        events = [action.names.get(event, event) for event in signature.outcomes]
        for event in events:
            if event in EXECUTIVES:
                yield _reserved(plot, event, here)
        yield from _outcomes(plot, name, [event for event in events if event not in EXECUTIVES], handled, path)


@dataclass(frozen=True, slots=True)
class _Traffic:
    """The events of a plot, collected once.

    Attributes:
        anywhere: events that every state may receive.
        inside: path of a state -> final events of its content and skills, and of states inside.
        heard: events with a transition.
    """

    anywhere: AbstractSet[str]
    inside: Mapping[Path, AbstractSet[str]]
    heard: AbstractSet[str]


def _traffic(plot: ActionPlot, library: Library, skills: Skills, nesting: Nesting) -> _Traffic:
    anywhere = {*(RESERVED - TIMERS), *plot.receives}
    inside: defaultdict[Path, set[str]] = defaultdict(set)
    heard: set[str] = {handler.on for handler in plot.handlers}
    for _, state, path in nesting.states:
        for _, _, transition in nesting.leaving(path):
            anywhere.update(transition.emitted)
        if not isinstance(state, State):
            continue
        heard.update(state.on)
        if ends := {*outcomes_of(state, library), *_skill_events(state, skills)}:
            for place in nesting.way(path):
                inside[place] |= ends
    return _Traffic(anywhere, inside, heard)


def _known_events(
    plot: ActionPlot, state: AnyState, path: Path, skills: Skills, traffic: _Traffic
) -> Iterator[Finding]:
    if not isinstance(state, State) or (isinstance(state, SubmachineState) and state.use.startswith("?")):
        return
    if skills is None and any(isinstance(a, Trigger) for a in state.entry):
        return
    inside = traffic.inside.get(path, frozenset())
    for event in state.on:
        if event not in traffic.anywhere and event not in inside:
            error = UnknownNameError(
                f"nothing here fires the event '{event}'", place=plot.place((*path, "on", event)),
                found=event, valid=(traffic.anywhere | inside) - RESERVED | {DONE},
            )  # fmt: skip
            yield Finding(error, "known event", "events from outside are declared under `receives`")


def _skill_events(state: AnyState, skills: Skills) -> set[str]:
    if skills is None or not isinstance(state, State):
        return set()
    triggers = [action for action in state.entry if isinstance(action, Trigger) and action.trigger in skills]
    return {t.names.get(event, event) for t in triggers for event in skills[t.trigger].outcomes}


def _emissions(plot: ActionPlot, path: Path, nesting: Nesting, traffic: _Traffic) -> Iterator[Finding]:
    for inside, _, transition in nesting.leaving(path):
        for fired in transition.emitted:
            here = (*path, *inside, "emit")
            if fired in RESERVED and fired not in plot.emits:
                yield _reserved(plot, fired, here)
            elif fired not in plot.emits and fired not in traffic.heard:
                error = UnknownNameError(
                    f"the plot does not declare the outcome '{fired}', and no state listens to it",
                    place=plot.place(here), found=fired, valid=set(plot.emits) | traffic.heard - {DONE, NO_CANDIDATE},
                )  # fmt: skip
                yield Finding(error, "declared outcome", "declare it under `emits`")
            elif fired in plot.emits and fired == transition.emit:
                yield from _attributes(plot, fired, set(transition.arguments), here)


def _final(plot: ActionPlot, state: FinalState, path: Path) -> Iterator[Finding]:
    if state.emit is None:
        return
    if state.emit not in plot.emits:
        error = UnknownNameError(
            f"the plot does not declare the outcome '{state.emit}'",
            place=plot.place((*path, "emit")), found=state.emit, valid=plot.emits,
        )  # fmt: skip
        yield Finding(error, "declared outcome", "declare it under `emits`")
    else:
        yield from _attributes(plot, state.emit, set(state.arguments), (*path, "emit"))


def _attributes(plot: ActionPlot, event: str, given: set[str], path: Path) -> Iterator[Finding]:
    declared = set(plot.emits[event] or ())
    for name in sorted(given ^ declared):
        problem = "is missing" if name in declared else "is not declared"
        error = SchemaError(
            f"attribute '{name}' of the outcome '{event}' {problem}", place=plot.place(path),
            found=name, valid=declared if name not in declared else (),
        )  # fmt: skip
        yield Finding(error, "outcome attributes")
