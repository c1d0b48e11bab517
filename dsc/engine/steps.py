"""Steps and their outputs: immutable values, which tests, trace and replay read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from dsc.engine.machine_state import NOTHING, MachineState
from dsc.engine.situation import Decision
from dsc.engine.taken import Taken
from dsc.events import AFTER, Event
from dsc.model.plot import ActionPlot
from dsc.rank import ORDINARY, Rank
from knowledge_base.facts import Delta


@dataclass(frozen=True, slots=True)
class Start:
    """Start a skill for an activation of a state.

    Attributes:
        action_id: permanent identifier of this execution of the skill.
        activation: serial number of the state's activation.
        component, skill: names of the component and of its skill.
        arguments: values for the skill's parameters, by name.
        names: event of the skill -> the name of this event in the chart.
        within: seconds after which the skill is cancelled; `None` means no limit.
        rank: the order in which skills get a component that executes one skill at a time.
    """

    action_id: str
    activation: int
    component: str
    skill: str
    arguments: Mapping[str, Any]
    names: Mapping[str, str] = field(default_factory=dict)
    within: float | None = None
    rank: Rank = ORDINARY

    @classmethod
    def from_json(cls, form: Mapping[str, Any]) -> Start:
        """Return the start with these fields, whose rank is a list."""
        return cls(**{**form, "rank": Rank(*form["rank"])})


@dataclass(frozen=True, slots=True)
class Cancel:
    """Stop the running skills and the timers of an exited state; `activation` is its serial number."""

    activation: int


@dataclass(frozen=True, slots=True)
class SetParameter:
    """Set a parameter of a component to a value.

    `activation` is the serial number of the activation that sends the command and receives its failure. It is 0 for an
    operator's command. The other commands have the same attribute.
    """

    component: str
    parameter: str
    value: Any
    activation: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class SwitchMode:
    """Switch a component to a mode."""

    component: str
    mode: str
    activation: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class SendMessage:
    """Send a one-way message to a port of a component."""

    component: str
    port: str
    arguments: Mapping[str, Any]
    activation: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class SetWire:
    """Wire a required port of a component to a provider, or to none, until `activation` ends; 0 has no end."""

    component: str
    port: str
    to: str | None
    activation: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class StartTimer:
    """Send an event to an activation after `seconds`; `index` is the position among the state's timers of this event.

    The event is dropped if the state is exited earlier.
    """

    activation: int
    index: int
    seconds: float
    event: str = AFTER


@dataclass(frozen=True, slots=True)
class SendLater:
    """Send an event to its plot instance after `seconds`; drop the event if this plot ends earlier (SCXML 6.2)."""

    event: Event
    seconds: float
    id: str = ""


@dataclass(frozen=True, slots=True)
class Revoke:
    """Drop the pending delayed events with this id in the plot instance with serial number `frame` (SCXML 6.3)."""

    frame: int
    id: str


@dataclass(frozen=True, slots=True)
class Note:
    """An entry for the trace: a log (SCXML 4.7), or an error event that an SCXML chart did not handle."""

    label: str
    text: str


Output = Start | Cancel | SetParameter | SwitchMode | SendMessage | SetWire | StartTimer | SendLater | Revoke | Note
"""One output of the machine: an external action, a timer, a delayed event or an entry for the trace."""


class PlotBound(NamedTuple):
    """A plot that became the content of a state; `state` is the state's path, empty for the outermost plot."""

    state: str
    plot: ActionPlot


NO_CHANGE = Delta()


class Microstep(NamedTuple):
    """Transitions taken together. A path from the root identifies each state, e.g. `clear/execute/step_2`."""

    event: Event | None
    taken: tuple[Taken, ...]
    exited: tuple[str, ...]
    entered: tuple[str, ...]
    bound: tuple[PlotBound, ...] = ()


@dataclass(frozen=True, slots=True)
class DecisionMade:
    """A decision record with the path of its dynamic state in `state`."""

    state: str
    decision: Decision


class Step(NamedTuple):
    """One macrostep: the reaction to one event, run to completion.

    Attributes:
        state: state of the machine after the macrostep.
        event: the handled event; `None` for the start or for a change of the knowledge.
        handled: whether a transition was taken on the event, or a waiting state keeps the event.
        microsteps: the microsteps, in order.
        decisions: decisions on the content of dynamic states, in order.
        knowledge: the chart's changes of the knowledge base, not yet committed.
        output: external actions and timers, in order.
        emitted: outcome events of the outermost plot, in order.
        errors: messages of failed actions or guards for which no transition on `error` exists. In dialect `scxml` these
            messages are notes in `output`, and the plot continues.
        outputs: values that the outermost plot returns; empty unless this step ends the plot.
        bugs: messages of failed user code for which no transition on `programming_error` exists.
    """

    state: MachineState
    event: Event | None
    handled: bool
    microsteps: tuple[Microstep, ...] = ()
    decisions: tuple[DecisionMade, ...] = ()
    knowledge: Delta = NO_CHANGE
    output: tuple[Output, ...] = ()
    emitted: tuple[Event, ...] = ()
    errors: tuple[str, ...] = ()
    outputs: Mapping[str, Any] = NOTHING
    bugs: tuple[str, ...] = ()

    @property
    def moved(self) -> bool:
        """Whether the step has at least one microstep."""
        return bool(self.microsteps)

    def entered(self, state: str) -> bool:
        """Return whether the step entered a state with this name, path or end of a path."""
        return any(_is(path, state) for micro in self.microsteps for path in micro.entered)

    def exited(self, state: str) -> bool:
        """Return whether the step exited a state with this name, path or end of a path."""
        return any(_is(path, state) for micro in self.microsteps for path in micro.exited)


def _is(path: str, state: str) -> bool:
    return path == state or path.endswith("/" + state)
