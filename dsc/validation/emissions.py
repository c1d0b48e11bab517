"""Review of outcomes: warnings about declared outcomes that the plot never emits."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.dynamic.steps import outcomes_of
from dsc.errors import Finding
from dsc.model.actions import Emit, Trigger, flat
from dsc.model.states import AnyState, FinalState, State, SubmachineState
from dsc.model.transitions import TransitionSource
from dsc.validation.flow import skill_events
from dsc.validation.subject import Subject


def review_outcomes(subject: Subject) -> Iterator[Finding]:
    """Yield a warning for each outcome under `emits` that no state, transition, skill or inner plot of the plot emits.

    Without the deployed skills, or with a plot that a variable names, the outcomes of inner parts are unknown.
    """
    if not subject.plot.emits:
        return
    states = [state for _, state, _ in subject.library.expanded(subject.plot).walk()]
    if any(_is_unknown(subject, state) for state in states):
        return
    emitted = {event for state in states for event in _events(subject, state)}
    for event in subject.plot.emits.keys() - emitted:
        message, fix = f"the plot never emits its outcome '{event}'", f"add `emit: {event}`, or remove the outcome"
        yield subject.finding(("emits", event), "emitted-outcome", message, fix, found=event, level="warning")


def _is_unknown(subject: Subject, state: AnyState) -> bool:
    if isinstance(state, SubmachineState) and state.use.startswith("?"):
        return True
    triggers = (one for one in (state.entry if isinstance(state, State) else ()) if isinstance(one, Trigger))
    return any(one.trigger not in (subject.skills or ()) for one in triggers)


def _events(subject: Subject, state: AnyState) -> Iterator[str]:
    """Yield the events that a state emits or lets pass: its own, those of its skills, and those of its content."""
    if isinstance(state, TransitionSource):
        for _, way in state.transitions():
            yield from way.emitted
    if isinstance(state, FinalState) and state.emit is not None:
        yield state.emit
    if isinstance(state, State):
        yield from (one.emit for one in flat((*state.entry, *state.exit, *state.on_break)) if isinstance(one, Emit))
        yield from outcomes_of(state, subject.library)
        yield from skill_events(state, subject.skills)
