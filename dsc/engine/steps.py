"""Steps and their outputs: values only, so that tests, trace and replay read one record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from dsc.engine.machine_state import NOTHING, MachineState
from dsc.engine.situation import Decision
from dsc.events import AFTER, Event
from dsc.model.plot import ActionPlot
from knowledge_base.facts import Delta


@dataclass(frozen=True, slots=True)
class Start:
    """Start a skill for an activation; `action_id` identifies this execution permanently."""

    action_id: str
    activation: int
    component: str
    skill: str
    arguments: Mapping[str, Any]
    names: Mapping[str, str] = field(default_factory=dict)
    within: float | None = None


@dataclass(frozen=True, slots=True)
class Cancel:
    """Stop the running skills and the timers of a state that was exited."""

    activation: int


@dataclass(frozen=True, slots=True)
class SetParameter:
    """Set a component's parameter."""

    component: str
    parameter: str
    value: Any


@dataclass(frozen=True, slots=True)
class SwitchMode:
    """Put a component into a mode."""

    component: str
    mode: str


@dataclass(frozen=True, slots=True)
class SendMessage:
    """Send a component a one-way message."""

    component: str
    port: str
    arguments: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class StartTimer:
    """Send the activation an event after `seconds`, for its timeout or period number `index`.

    The event is dropped if the state was exited before.
    """

    activation: int
    index: int
    seconds: float
    event: str = AFTER


@dataclass(frozen=True, slots=True)
class SendLater:
    """Send an event from outside after `seconds`; it is dropped if its plot has ended before (SCXML 6.2)."""

    event: Event
    seconds: float
    id: str = ""


@dataclass(frozen=True, slots=True)
class Revoke:
    """Drop the pending events of that id for the plot instance `frame` (SCXML 6.3)."""

    frame: int
    id: str


@dataclass(frozen=True, slots=True)
class Note:
    """An entry for the trace: a log (SCXML 4.7), or an error event that an SCXML chart did not take."""

    label: str
    text: str


Output = Start | Cancel | SetParameter | SwitchMode | SendMessage | StartTimer | SendLater | Revoke | Note
"""The machine's output, in order."""


@dataclass(frozen=True, slots=True)
class Taken:
    """A transition that was taken.

    Attributes:
        source, target: paths of its states.
        trigger: the event, `after` or `always`.
        rule: label of the contingency rule it comes from.
        plot: name of the plot that has it.
        place: its place in its source state, e.g. `("on", "grasped", 0)`.
    """

    source: str
    trigger: str
    target: str | None
    rule: str | None = None
    plot: str = ""
    place: tuple[str | int, ...] = ()


class PlotBound(NamedTuple):
    """A running plot that became a state's content; `state` is the state's path, empty for the outermost plot."""

    state: str
    plot: ActionPlot


NO_CHANGE = Delta()


class Microstep(NamedTuple):
    """Transitions taken together. States are named by their path from the root, e.g. `clear/execute/step_2`."""

    event: Event | None
    taken: tuple[Taken, ...]
    exited: tuple[str, ...]
    entered: tuple[str, ...]
    bound: tuple[PlotBound, ...] = ()


@dataclass(frozen=True, slots=True)
class DecisionMade:
    """A decision record with the path of its dynamic state."""

    state: str
    decision: Decision


class Step(NamedTuple):
    """One macrostep: run to completion of one event.

    Attributes:
        state: the machine's next state.
        event: the event; `None` for the start.
        handled: whether a transition took the event itself.
        microsteps: the microsteps, in order.
        decisions: the decisions of dynamic states.
        knowledge: the changes of the chart to the knowledge base.
        output: external actions and timers, in order.
        emitted: outcome events of the outermost plot.
        errors: failed evaluations of actions or guards without a transition on `error`. In dialect `scxml` they are
            notes in `output`, and the plot continues.
        outputs: values that the outermost plot returns, if this step ends it.
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

    @property
    def moved(self) -> bool:
        """Whether the step changed or sent anything."""
        return bool(self.microsteps)

    def entered(self, state: str) -> bool:
        """Return whether a state of that name or path was entered."""
        return any(_is(path, state) for micro in self.microsteps for path in micro.entered)

    def exited(self, state: str) -> bool:
        """Return whether a state of that name or path was exited."""
        return any(_is(path, state) for micro in self.microsteps for path in micro.exited)


def _is(path: str, state: str) -> bool:
    return path == state or path.endswith("/" + state)
