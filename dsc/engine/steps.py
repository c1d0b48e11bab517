"""What a step is and what it hands out: values only, so that tests, trace and replay read one record."""

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
    """Start a skill for an activation; `action_id` names this execution for ever."""

    action_id: str
    activation: int
    component: str
    skill: str
    arguments: Mapping[str, Any]
    names: Mapping[str, str] = field(default_factory=dict)
    within: float | None = None


@dataclass(frozen=True, slots=True)
class Cancel:
    """The state was left: skills it started that still run have to stop, and its timers with them."""

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
    """Send the activation the event, for its timeout or period number `index`, after `seconds`.

    It is dropped if the state was left by then.
    """

    activation: int
    index: int
    seconds: float
    event: str = AFTER


@dataclass(frozen=True, slots=True)
class SendLater:
    """Hand the event in from outside after `seconds`; it is dropped if its plot is gone by then (SCXML 6.2)."""

    event: Event
    seconds: float
    id: str = ""


@dataclass(frozen=True, slots=True)
class Revoke:
    """Do not hand in the events of that id that are still to come for the plot instance `frame` (SCXML 6.3)."""

    frame: int
    id: str


@dataclass(frozen=True, slots=True)
class Note:
    """Something to be written into the trace: a log (SCXML 4.7), or an error event of an SCXML chart not taken."""

    label: str
    text: str


Output = Start | Cancel | SetParameter | SwitchMode | SendMessage | StartTimer | SendLater | Revoke | Note
"""What leaves the machine, in order."""


@dataclass(frozen=True, slots=True)
class Taken:
    """A transition that was taken.

    Attributes:
        source, target: paths of its states.
        trigger: the event, `after` or `always`.
        rule: label of the contingency rule it comes from.
        plot: name of the plot that has it.
        place: where it stands in its source state, e.g. `("on", "grasped", 0)`.
    """

    source: str
    trigger: str
    target: str | None
    rule: str | None = None
    plot: str = ""
    place: tuple[str | int, ...] = ()


class PlotBound(NamedTuple):
    """A plot that became the content of a state (named by its path; empty for the outermost plot), as it runs."""

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
    """A dynamic state, by path, with its decision record."""

    state: str
    decision: Decision


class Step(NamedTuple):
    """One macrostep: run to completion of one event.

    Attributes:
        state: the machine's next state.
        event: what it reacted to; `None` for the start.
        handled: whether any transition took the event itself.
        microsteps: what happened, in order.
        decisions: what dynamic states chose.
        knowledge: what the chart told the knowledge base.
        output: external actions and timers, in order.
        emitted: outcome events of the outermost plot.
        errors: actions or guards that could not be evaluated and that no transition on `error` took; those of
            plots in dialect `scxml`, which go on, are notes in `output`.
        outputs: what the outermost plot hands back, as it has reached its end with this step.
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
        """Whether anything happened at all."""
        return bool(self.microsteps)

    def entered(self, state: str) -> bool:
        """Whether a state of that name or path was entered."""
        return any(_is(path, state) for micro in self.microsteps for path in micro.entered)

    def exited(self, state: str) -> bool:
        """Whether a state of that name or path was left."""
        return any(_is(path, state) for micro in self.microsteps for path in micro.exited)


def _is(path: str, state: str) -> bool:
    return path == state or path.endswith("/" + state)
