"""Events: every declared outcome is wired, every wired event can happen, every end is noticed (S2.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache

from dsc.dynamic.library import Library
from dsc.dynamic.outcomes import outcomes_of
from dsc.errors import Finding
from dsc.events import DONE, GAVE_UP, NO_CANDIDATE, NO_PLAN, RESERVED
from dsc.model.actions import Trigger
from dsc.model.plot import ActionPlot, Path, walk_states
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    OrthogonalState,
    State,
    SubmachineState,
)
from dsc.skills import SkillSignature
from dsc.validation.structure import RESPONSES, around
from knowledge_base.errors import InputError, SchemaError, UnknownNameError

Skills = Mapping[str, SkillSignature] | None

_EXECUTIVES = RESERVED - {NO_PLAN, GAVE_UP}
"""Events that are nobody else's; the other two are passed on by who plans."""


def check_wiring(plot: ActionPlot, library: Library, skills: Skills) -> Iterator[Finding]:
    """Findings about events."""
    try:
        expanded = library.expanded(plot)
    except InputError as error:
        yield Finding(error, "rules")
        return
    wired = {name: state for name, state, _ in expanded.walk()}
    local, listened = _local_events(plot), _listened(plot)
    silent = cache(lambda used: _ends_silently(library.plot(used)))
    yield from _declared_events(plot)
    yield from _rule_targets(plot, library)
    for name, state, path in plot.walk():
        if isinstance(state, FinalState):
            yield from _final(plot, state, path)
        if not isinstance(state, State):
            continue
        handled = _handled([wired[name], *around(plot, path)])
        yield from _outcomes(plot, name, outcomes_of(state, library), handled, path)
        yield from _skills(plot, name, state, path, handled, skills)
        if plot.profile == "dsc":  # in SCXML an event that nobody takes, or nobody fires, is no mistake
            yield from _completion(plot, name, state, wired[name], path, silent)
            yield from _known_events(plot, name, state, path, library, skills, local)
            yield from _emissions(plot, state, path, listened)


def _declared_events(plot: ActionPlot) -> Iterator[Finding]:
    for event in plot.emits:
        if event in _EXECUTIVES:
            yield _reserved(plot, event, ("emits", event))
    for event in plot.receives:
        if event in RESERVED:
            yield _reserved(plot, event, ("receives", event))


def _reserved(plot: ActionPlot, event: str, path: Path) -> Finding:
    error = SchemaError(
        f"the event '{event}' is fired by the executive itself", place=plot.place(path), found=event
    )
    return Finding(error, "reserved event", "give yours another name; `as` renames a skill's")


def _rule_targets(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    """A rule goes to a state beside the one it answers for."""
    scopes = [(siblings, [(n, outcomes_of(s, library)) for n, s in siblings.items()]) for siblings in plot.scopes()]
    for number, rule in enumerate(plot.rules):
        for siblings, states in scopes:
            for name, outcomes in states:
                answers = rule.on in outcomes and (not rule.of or name in rule.of)
                if answers and rule.do.then not in RESPONSES and rule.do.then not in siblings:
                    error = SchemaError(
                        f"the rule's way from '{name}' to '{rule.do.then}' crosses a border",
                        place=plot.place(("rules", number, "do", "then")), found=rule.do.then, valid=siblings,
                    )  # fmt: skip
                    yield Finding(error, "no border crossing", "say with `of` for which states the rule is")


def _handled(states: Iterable[AnyState]) -> dict[str, bool]:
    """Event -> whether some transition takes it whatever the guards say."""
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
            message = f"state '{name}' may not handle its outcome '{event}': every transition has a guard"
            fix = "add a last transition or rule without `when`"
        else:
            message = f"state '{name}' does not handle its outcome '{event}'"
            fix = f"add `{event}: STATE` under `on`, or a rule"
        error = SchemaError(message, place=plot.place((*path, "on", event)))
        yield Finding(error, "every outcome is wired", fix)


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
            if event in _EXECUTIVES:
                yield _reserved(plot, event, here)
        yield from _outcomes(plot, name, [event for event in events if event not in _EXECUTIVES], handled, path)


def _completion(
    plot: ActionPlot, name: str, state: AnyState, wired: AnyState, path: Path, silent: Callable[[str], bool]
) -> Iterator[Finding]:
    completes = (
        (isinstance(state, SubmachineState) and (state.use.startswith("?") or silent(state.use)))
        or (isinstance(state, DynamicState) and (state.goal is not None or any(map(silent, state.dynamic))))
        or (isinstance(state, CompositeState) and any(isinstance(s, FinalState) for s in state.states.values()))
        or isinstance(state, OrthogonalState)
    )
    if type(state) is State and DONE in state.on and any(isinstance(a, Trigger) for a in state.entry):
        error = SchemaError(
            f"state '{name}' has no content, so it is done at once and would cancel its skill",
            place=plot.place((*path, "on", DONE)),
        )
        yield Finding(error, "done at once", "wire the outcome of the skill")
    if completes and isinstance(wired, State) and DONE not in wired.on:
        error = SchemaError(f"state '{name}' does not handle its completion", place=plot.place((*path, "on")))
        yield Finding(error, "completion is wired", "add `done: STATE` under `on`")


def _ends_silently(plot: ActionPlot) -> bool:
    """Whether the plot can reach a top-level final state without firing a declared outcome."""
    silent = {name for name, s in plot.states.items() if isinstance(s, FinalState) and s.emit is None}
    return any(
        transition.target in silent and not set(transition.emitted) & set(plot.emits)
        for state in plot.states.values()
        if isinstance(state, State)
        for _, transition in state.transitions()
    )


def _known_events(
    plot: ActionPlot, name: str, state: AnyState, path: Path, library: Library, skills: Skills, local: set[str]
) -> Iterator[Finding]:
    if not isinstance(state, State) or (isinstance(state, SubmachineState) and state.use.startswith("?")):
        return
    known = RESERVED | set(plot.receives) | local
    for _, inner, _ in walk_states({name: state}, path[:-1]):
        known = known | set(outcomes_of(inner, library)) | _skill_events(inner, skills)
    if skills is None and any(isinstance(a, Trigger) for a in state.entry):
        return
    for event in state.on:
        if event not in known:
            error = UnknownNameError(
                f"nothing here fires the event '{event}'",
                place=plot.place((*path, "on", event)), found=event, valid=known - RESERVED | {DONE},
            )  # fmt: skip
            yield Finding(error, "known event", "events from outside are declared under `receives`")


def _local_events(plot: ActionPlot) -> set[str]:
    states = [state for _, state, _ in plot.walk() if isinstance(state, State)]
    return {event for state in states for _, transition in state.transitions() for event in transition.emitted}


def _skill_events(state: AnyState, skills: Skills) -> set[str]:
    if skills is None or not isinstance(state, State):
        return set()
    triggers = [action for action in state.entry if isinstance(action, Trigger) and action.trigger in skills]
    return {t.names.get(event, event) for t in triggers for event in skills[t.trigger].outcomes}


def _listened(plot: ActionPlot) -> set[str]:
    return {event for _, state, _ in plot.walk() if isinstance(state, State) for event in state.on}


def _emissions(plot: ActionPlot, state: AnyState, path: Path, listened: set[str]) -> Iterator[Finding]:
    if not isinstance(state, State):
        return
    for inside, _, transition in state.placed_transitions():
        for fired in transition.emitted:
            here = (*path, *inside, "emit")
            if fired in RESERVED and fired not in plot.emits:
                yield _reserved(plot, fired, here)
            elif fired not in plot.emits and fired not in listened:
                error = UnknownNameError(
                    f"the plot does not declare the outcome '{fired}', and no state listens to it",
                    place=plot.place(here), found=fired, valid=set(plot.emits) | listened - {DONE, NO_CANDIDATE},
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
