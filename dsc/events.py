"""Events as values, with the scope in which each is visible (S0.6, S2.5)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

DONE = "done"
"""Completion of a state's content (S0.11)."""
AFTER = "after"
"""Timeout of a state; `Event.number` is the index of the timeout."""
EVERY = "every"
"""End of a period of a state; `Event.number` is the index of the cyclic transition."""
CYCLE = "cycle"
"""Begin of a cycle of a plot with a robot section; its attributes are the values of the sensors (S3.2)."""
AT_LEAST = "at_least"
"""End of the minimum duration of a state."""
NO_CANDIDATE = "no_candidate"
"""Failure of a dynamic state without a goal: no candidate fits (S0.4)."""
NO_PLAN = "no_plan"
"""Failure of a dynamic state with a goal: the planner finds no plan."""
GAVE_UP = "gave_up"
"""Failure of a dynamic state with a goal: a rule abandoned the goal, or the goal's budget is exhausted."""
TIMED_OUT = "timed_out"
"""Failure of a skill: it did not end before its deadline and was cancelled."""
SKILL_ERROR = "skill_error"
"""Failure of a skill's infrastructure, or of a command: a device is lost, or the skill's effect is unknown."""
PROGRAMMING_ERROR = "programming_error"
"""Failure of code: a skill raised an undeclared exception, or ended without a valid outcome.

Only a transition, rule or handler that names the event responds to it; otherwise the event ends the run.
"""
PREEMPTED = "preempted"
"""Loss of a component to a skill with a higher priority; by default, the state is entered again and waits (S1.21)."""
COMPONENT_FAILED = "component_failed"
"""Failure of a component that no skill or command can report to its state; all plots see the event."""
COMPONENT_RECOVERED = "component_recovered"
"""End of the failure of a component; all plots see the event."""
ERROR = "error"
"""Failure of the evaluation of an action or guard."""
DONE_STATE = "done.state."
"""Prefix of event `done` in dialect `scxml`; the state's name is the suffix (SCXML 3.13)."""
EXECUTION_ERROR = "error.execution"
"""Name of event `error` in dialect `scxml` (SCXML 3.13)."""
FAILURES = frozenset({SKILL_ERROR, TIMED_OUT})
"""Failures of any skill to which generated plots and handlers respond."""
SKILL_FAILURES = FAILURES | {PROGRAMMING_ERROR}
"""Failures that any skill can have.

If no state of the skill's plot handles such an event, the states around the plot may handle it.
"""
LED_AWAY = "then."
"""Prefix of an outcome of a generated plot; such an outcome leads to a state of the plot that declares the goal."""
ERRORS = frozenset({ERROR, EXECUTION_ERROR, PROGRAMMING_ERROR})
"""Events of failed evaluations."""

TIMERS = frozenset({AFTER, EVERY, AT_LEAST})
"""Events of the executive's clock for one state; no transition may have them under `on`."""
RESERVED = (
    TIMERS
    | {DONE, NO_CANDIDATE, NO_PLAN, GAVE_UP, TIMED_OUT, PREEMPTED, COMPONENT_FAILED, COMPONENT_RECOVERED, ERROR}
    | SKILL_FAILURES
)
"""Events that only the executive fires, with one exception.

Plots and skills for planning may also end with `no_plan` and `gave_up`.
"""
EXECUTIVES = RESERVED - {NO_PLAN, GAVE_UP}
"""Events that only the executive fires, without exception."""

NO_ATTRIBUTES: Mapping[str, Any] = MappingProxyType({})
"""Empty attributes, which most events share; the mapping is immutable."""


def goes_outwards(event: str) -> bool:
    """Return whether the states around a plot may handle the event if no state of the plot handles it."""
    return event in SKILL_FAILURES or event.startswith(LED_AWAY)


class Event(NamedTuple):
    """An occurrence that transitions react to.

    A named tuple, as a run creates many events and a frozen dataclass takes four times as long to create.

    Attributes:
        name: the label of transitions.
        attributes: data, read in charts as `?event.attribute`.
        to: the activation (serial number of one entry into one state) that receives the event. Only that state, and the
            states around it in its plot, receive the event. The event is dropped if that state is no longer active.
        exact: with `to`: only that state may handle the event.
        frame: the plot instance in which the event is visible. Without `to` and `frame`, it is visible everywhere.
        number: the index of the state's timeout or period.
        inside: with `to`: states inside that state see the event too, and so do those around the plot if the plot
            declares the event under `emits`.
    """

    name: str
    attributes: Mapping[str, Any] = NO_ATTRIBUTES
    to: int | None = None
    exact: bool = False
    frame: int | None = None
    number: int | None = None
    inside: bool = False

    def bindings(self) -> dict[str, Any]:
        """Return the attributes by their name in charts, `event.attribute`."""
        return {f"event.{name}": value for name, value in self.attributes.items()}


def command_failure(name: str, component: str, port: str, reason: str, to: int) -> Event:
    """Return the event for the failure of a command; its attribute `component` distinguishes it from a skill's failure.

    Args:
        name: `SKILL_ERROR` or `PROGRAMMING_ERROR`.
        component: the component that could not take the command.
        port: the component's port that received the command, as `arm.force`.
        reason: the error.
        to: the activation that sent the command.
    """
    return Event(name, {"skill": port, "component": component, "reason": reason}, to=to)


def for_all_plots(event: Event) -> Event | None:
    """Return the failure of a command as the failure of its component; `None` for other events."""
    if event.name != SKILL_ERROR or "component" not in event.attributes:
        return None
    return Event(COMPONENT_FAILED, {name: event.attributes[name] for name in ("component", "reason")})
