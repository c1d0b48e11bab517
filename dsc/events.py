"""Events as values, with the scope in which they are visible (S0.6, S2.5)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

DONE = "done"
"""Completion of a state's content (S0.11)."""
AFTER = "after"
"""A timeout of a state; `index` says which."""
EVERY = "every"
"""A period of a state has passed again; `index` says which of its cyclic transitions."""
AT_LEAST = "at_least"
"""The time that a state stays at least has passed."""
NO_CANDIDATE = "no_candidate"
"""A dynamic state without goal found no candidate that fits (S0.4)."""
NO_PLAN = "no_plan"
"""A dynamic state's goal cannot be planned for."""
GAVE_UP = "gave_up"
"""A dynamic state's goal was abandoned by a rule, or because its budget was spent."""
TIMED_OUT = "timed_out"
"""A skill did not end within its time and was cancelled."""
SKILL_ERROR = "skill_error"
"""A skill raised an exception, or ended without a valid outcome."""
ERROR = "error"
"""An action or guard could not be evaluated."""
DONE_STATE = "done.state."
"""The name of `done` in dialect `scxml`, with the state's name as suffix (SCXML 3.13)."""
EXECUTION_ERROR = "error.execution"
"""The name of `error` in dialect `scxml` (SCXML 3.13)."""
FAILURES = frozenset({SKILL_ERROR, TIMED_OUT})
"""Ends of any skill. If no state of its plot takes one, the states around the plot may."""
LED_AWAY = "then."
"""Prefix of outcomes of generated plots that lead to a state of the plot with the goal."""
ERRORS = frozenset({ERROR, EXECUTION_ERROR})

TIMERS = frozenset({AFTER, EVERY, AT_LEAST})
"""Events of the executive's clock for one state; no transition has them under `on`."""
RESERVED = TIMERS | {DONE, NO_CANDIDATE, NO_PLAN, GAVE_UP, TIMED_OUT, SKILL_ERROR, ERROR}
"""Events that only the executive fires, except that plots and skills for planning may end with `no_plan` and
`gave_up`."""
EXECUTIVES = RESERVED - {NO_PLAN, GAVE_UP}
"""Events that only the executive fires, without exception."""

NO_ATTRIBUTES: Mapping[str, Any] = MappingProxyType({})
"""Of most events; shared, as it is immutable."""


def goes_outwards(event: str) -> bool:
    """Whether the states around a plot may take the event if no state inside does."""
    return event in FAILURES or event.startswith(LED_AWAY)


class Event(NamedTuple):
    """Something that happened; a named tuple, since many are made and a frozen dataclass takes four times as long.

    Attributes:
        name: the label of transitions.
        attributes: data, read in charts as `?event.attribute`.
        to: the activation (serial number of one entry into one state) that it is for. Only that state and the states
            around it in the same plot see it. An event for a state that was left is dropped.
        exact: with `to`: that state alone may take it.
        frame: the plot instance inside which it is visible; without `to` and `frame`, it is visible everywhere.
        number: the index of the state's timeout or period.
    """

    name: str
    attributes: Mapping[str, Any] = NO_ATTRIBUTES
    to: int | None = None
    exact: bool = False
    frame: int | None = None
    number: int | None = None

    def bindings(self) -> dict[str, Any]:
        """Its attributes under the names charts use, `event.attribute`."""
        return {f"event.{name}": value for name, value in self.attributes.items()}
