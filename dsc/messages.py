"""Messages to the sequencer, and commands to components without an answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.engine.plot_changes import ActivePlots
from dsc.engine.steps import SendLater, SendMessage, SetParameter, Start, StartTimer, SwitchMode
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from knowledge_base.facts import Delta, Value


@dataclass(frozen=True, slots=True)
class SkillMessage:
    """A component's report or outcome for one execution of a skill.

    Attributes:
        start: the start of the skill.
        outcome: the skill's event with its attributes, and the observed facts.
        final: whether this message ends the skill.
        continues: whether the skill still executes although it counts as ended; the sequencer then cancels the skill.
        conflated: number of older reports of an equal event that this message replaces, see `dsc.calls`.
        declared: the declared types of the outcome's attributes; `None` if there are no types to validate.
        activated: whether the message is a component event, which the state has activated, see `Event.inside`.
    """

    start: Start
    outcome: Outcome
    final: bool
    continues: bool = False
    conflated: int = 0
    declared: Mapping[str, str | None] | None = None
    activated: bool = False


@dataclass(frozen=True, slots=True)
class TimerMessage:
    """The expiry of a timer."""

    timer: StartTimer


@dataclass(frozen=True, slots=True)
class KnowledgeMessage:
    """A change of the knowledge by an author outside of this run."""

    delta: Delta
    author: str


@dataclass(frozen=True, slots=True)
class ParameterMessage:
    """An operator's change of a parameter.

    Attributes:
        owner: the component or plot of the parameter.
        name: the parameter's name.
        value: the new value; `None` restores the value that a component's parameter had before.
        of_plot: whether the owner is a plot.
    """

    owner: str
    name: str
    value: Value | None
    of_plot: bool


@dataclass(frozen=True, slots=True)
class WireMessage:
    """An operator's wire of a required port.

    Attributes:
        port: the required port, as `component.port`.
        to: the provided port, as `component.port`, or a component; `None` cuts the wire.
    """

    port: str
    to: str | None


@dataclass(frozen=True, slots=True)
class PlotsMessage:
    """A change of the plots of a run.

    Attributes:
        plots: the new plots by name; `None` removes a plot.
        active: the treatment of running plots that are replaced, see `ActivePlots`.
        components: new components by name, each with its skills as plain data.
    """

    plots: Mapping[str, ActionPlot | None]
    active: ActivePlots = "at_next_entry"
    components: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LateMessage:
    """A message from outside that was scheduled; `number` distinguishes it from other scheduled messages."""

    message: FromOutside
    number: int


FromOutside = Event | KnowledgeMessage | ParameterMessage | WireMessage | PlotsMessage
"""Messages from outside of the run."""
Message = SkillMessage | TimerMessage | FromOutside | LateMessage | SendLater
"""Messages that the sequencer handles; a `SendLater` is the chart's own delayed event."""
Told = SetParameter | SwitchMode | SendMessage
"""Commands to components without an answer: parameters, modes and messages."""
