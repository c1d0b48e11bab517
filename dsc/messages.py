"""Messages to the sequencer, and commands to components without an answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dsc.calls import Outcome
from dsc.engine.steps import SendLater, SendMessage, SetParameter, Start, StartTimer, SwitchMode
from dsc.events import Event
from knowledge_base.facts import Delta, Value


@dataclass(frozen=True, slots=True)
class SkillMessage:
    """A component's answer for an activation.

    Attributes:
        start: of the skill.
        outcome: event, attributes and observed facts.
        final: whether the skill has ended with it.
        goes_on: whether the skill only counts as ended, and is to be cancelled.
        conflated: number of older reports of the same event that it replaces, see `dsc.calls`.
        declared: the declared types of the outcome's attributes; `None` if there are none to validate.
    """

    start: Start
    outcome: Outcome
    final: bool
    goes_on: bool = False
    conflated: int = 0
    declared: Mapping[str, str | None] | None = None


@dataclass(frozen=True, slots=True)
class TimerMessage:
    """A timer is due."""

    timer: StartTimer


@dataclass(frozen=True, slots=True)
class KnowledgeMessage:
    """An author outside of this run changes the knowledge."""

    delta: Delta
    author: str


@dataclass(frozen=True, slots=True)
class ParameterMessage:
    """An operator sets a parameter.

    Attributes:
        owner: the component or plot of the parameter.
        name, value: of the parameter; `None` takes back the value set before, of a component's.
        of_plot: whether the owner is a plot.
    """

    owner: str
    name: str
    value: Value | None
    of_plot: bool


@dataclass(frozen=True, slots=True)
class LateMessage:
    """A message from outside with a later time, which has come; `number` tells it from others."""

    message: FromOutside
    number: int


FromOutside = Event | KnowledgeMessage | ParameterMessage
"""Messages from outside of the run."""
Message = SkillMessage | TimerMessage | KnowledgeMessage | ParameterMessage | LateMessage | SendLater | Event
"""A `SendLater` is the chart's own event whose time has come."""
Told = SetParameter | SwitchMode | SendMessage
"""Commands to components without an answer: parameters, modes and messages."""
