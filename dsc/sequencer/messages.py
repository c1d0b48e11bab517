"""What reaches the sequencer, in the order in which it comes."""

from __future__ import annotations

from dataclasses import dataclass

from dsc.calls import Outcome
from dsc.engine.steps import SendLater, Start, StartTimer
from dsc.events import Event
from knowledge_base.facts import Delta, Value


@dataclass(frozen=True, slots=True)
class SkillMessage:
    """A component's answer for an activation.

    Attributes:
        start: of the skill.
        outcome: what it said.
        final: whether the skill has ended with it.
        goes_on: whether it has not, and only counts as ended: it has to be stopped.
        conflated: how many older reports of the same event it stands for, see `dsc.components.reports`.
    """

    start: Start
    outcome: Outcome
    final: bool
    goes_on: bool = False
    conflated: int = 0


@dataclass(frozen=True, slots=True)
class TimerMessage:
    """A timer is due."""

    timer: StartTimer


@dataclass(frozen=True, slots=True)
class KnowledgeMessage:
    """Somebody who is no skill of this run changes the knowledge."""

    delta: Delta
    author: str


@dataclass(frozen=True, slots=True)
class ParameterMessage:
    """An operator says what a parameter is worth from now on.

    Attributes:
        owner: the component, or the plot, that has it.
        name, value: of the parameter; `None` takes back what was said of a component's.
        of_plot: whether it is a plot's.
    """

    owner: str
    name: str
    value: Value | None
    of_plot: bool


@dataclass(frozen=True, slots=True)
class LateMessage:
    """Something that was handed in from outside to come later, and now is there; `number` tells it from others."""

    message: FromOutside
    number: int


FromOutside = Event | KnowledgeMessage | ParameterMessage
"""What somebody hands in who is no part of the run."""
Message = SkillMessage | TimerMessage | KnowledgeMessage | ParameterMessage | LateMessage | SendLater | Event
"""A `SendLater` is the chart's own event whose time has come."""
