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
"""A dynamic state's goal was given up: a rule said so, or the budget was spent."""
TIMED_OUT = "timed_out"
"""A skill did not end within its time and was cancelled."""
SKILL_ERROR = "skill_error"
"""A skill raised, or said what cannot be, instead of ending with one of its outcomes."""
ERROR = "error"
"""An action or guard could not be evaluated."""
DONE_STATE = "done.state."
"""What `done` is called in dialect `scxml`, with the state's name after it (SCXML 3.13)."""
EXECUTION_ERROR = "error.execution"
"""What `error` is called in dialect `scxml` (SCXML 3.13)."""
FAILURES = frozenset({SKILL_ERROR, TIMED_OUT})
"""How any skill may end. What no state of its plot takes goes outwards, to the states that hold plots."""
LED_AWAY = "then."
"""What the outcomes of generated plots begin with that lead to a state of the plot which holds the goal."""
ERRORS = frozenset({ERROR, EXECUTION_ERROR})

TIMERS = frozenset({AFTER, EVERY, AT_LEAST})
"""What the executive's clock says to one state; no transition has them under `on`."""
RESERVED = TIMERS | {DONE, NO_CANDIDATE, NO_PLAN, GAVE_UP, TIMED_OUT, SKILL_ERROR, ERROR}
"""Events the executive fires itself. Nobody else declares any of them, except that plots and skills that plan may end
with `no_plan` and `gave_up`."""
EXECUTIVES = RESERVED - {NO_PLAN, GAVE_UP}
"""Events that are nobody else's; the other two are passed on by who plans."""

NO_ATTRIBUTES: Mapping[str, Any] = MappingProxyType({})
"""Of most events; shared, as nobody can change it."""


def goes_outwards(event: str) -> bool:
    """Whether what no state of a plot takes is offered to the states that hold plots around it."""
    return event in FAILURES or event.startswith(LED_AWAY)


class Event(NamedTuple):
    """Something that happened; a named tuple, since many are made and a frozen dataclass takes four times as long.

    Attributes:
        name: what transitions are labelled with.
        attributes: data, read in charts as `?event.attribute`.
        to: the activation (serial number of one entry into one state) it is for; the state and the states
            around it in the same plot see it, nobody else. An event for a state that was left is dropped.
        exact: with `to`: that state alone may take it.
        frame: the plot instance inside which it is visible; with neither, everybody sees it.
        number: which of the state's timeouts or periods.
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
