"""Dry run of the machine alone: tests send events and advance a clock, without skills and without an event loop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.steps import (
    Cancel,
    Note,
    Output,
    Revoke,
    SendLater,
    SendMessage,
    SetParameter,
    SetWire,
    Start,
    StartTimer,
    Step,
    SwitchMode,
)
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.sequencer.dispatcher import DEFAULT_WITHIN
from dsc.sequencer.message_checks import late
from dsc.sequencer.reactor import CHART
from dsc.testing.fixtures import change_of, world
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase

_ROUNDING = 1e-9
"""Tolerance in seconds for sums of floating-point numbers."""


@dataclass(frozen=True, slots=True)
class _Due:
    """A pending event.

    The event is dropped when its activation is exited, its skill answers, or its `send` is revoked. `action_id`
    identifies the skill; `sent` has the plot instance and the id for a revocation.
    """

    at: float
    event: Event
    activation: int | None = None
    action_id: str | None = None
    sent: tuple[int | None, str] | None = None


class DryRun:
    """A started plot that reacts only to method calls of the test.

    Args:
        plots: the library, or its plots.
        plot: the name of the plot to run.
        arguments: values for the plot's parameters.
        knowledge: the world model, which the plot changes; by default an empty one.

    Attributes:
        library: the available plots.
        machine: the machine, with its state.
        knowledge: the world model.
        now: seconds since the start.
        steps: all steps so far; see `predicates`.
        running: the skills that were started and have neither answered nor been cancelled.

    Raises:
        InputError: the plot is unknown, or a parameter is missing or unknown.
        RunawayError: a macrostep does not end.
    """

    def __init__(
        self,
        plots: Iterable[ActionPlot],
        plot: str,
        arguments: Mapping[str, Any] | None = None,
        knowledge: KnowledgeBase | None = None,
    ) -> None:
        self.library = Library(plots)
        self.machine = Machine(self.library)
        self.knowledge = knowledge if knowledge is not None else world()
        self.now = 0.0
        self.steps: list[Step] = []
        self.running: list[Start] = []
        self._due: list[_Due] = []
        self._keep(self.machine.start(plot, arguments or {}, self._situation()))

    @property
    def active(self) -> tuple[str, ...]:
        """The paths of all active states, outermost first."""
        return self.machine.state.configuration()

    @property
    def finished(self) -> bool:
        """Whether the plot has reached its final state."""
        return self.machine.state.finished

    @property
    def emitted(self) -> tuple[Event, ...]:
        """The plot's outcome events, in order."""
        return tuple(event for step in self.steps for event in step.emitted)

    def send(self, event: str, /, **attributes: Any) -> Step:
        """Send an event from outside to all states; return the step."""
        return self._send(Event(event, attributes))

    def answer(
        self, skill: str, event: str, attributes: Mapping[str, Any] | None = None, *, observed: Delta | str = ""
    ) -> Step:
        """End a running skill with an outcome, and return the step.

        Args:
            skill: `component.skill`; of several running executions of the skill, the one that started first ends.
            event: the outcome, by the skill's own name for it.
            attributes: the event's attributes.
            observed: the outcome's observations: a change, or a PDDL effect. In an effect, `?name` is the value of an
                argument of the skill.

        Returns:
            The step; if it is not `handled`, a sequencer would end the run.

        Raises:
            UnknownNameError: no such skill is running.
        """
        start = next((one for one in self.running if _skill(one) == skill), None)
        if start is None:
            raise UnknownNameError(f"no skill '{skill}' is running", found=skill, valid=map(_skill, self.running))
        self._end(start.action_id)
        if observed:
            self.knowledge.apply(change_of(observed, self.knowledge, start.arguments), start.component)
        return self._send(Event(start.names.get(event, event), attributes or {}, to=start.activation))

    def change(self, what: Delta | str, author: str = "somebody") -> Step:
        """Change the knowledge from outside, and return the step.

        Args:
            what: a change, or a PDDL effect on the present world.
            author: the change's author.
        """
        self.knowledge.apply(change_of(what, self.knowledge), author)
        return self._send(None)

    def leave(self) -> Step:
        """End the run from outside: exit all active states, whose exit actions stop the components; return the step."""
        return self._keep(self.machine.leave(self._situation()))

    def advance(self, seconds: float) -> tuple[Step, ...]:
        """Advance the time; return the steps of pending events, which are sent in order of their times.

        A skill that exceeds its deadline ends with `timed_out`.

        Raises:
            InputError: `seconds` is negative.
        """
        if seconds < 0:
            raise InputError(f"time does not go backwards: {seconds:g} s")
        until = self.now + seconds
        before = len(self.steps)
        while (due := min(self._due, key=lambda one: one.at, default=None)) and due.at <= until + _ROUNDING:
            self.now = due.at
            self._due.remove(due)
            if due.action_id is not None:
                self._end(due.action_id)
            self._send(due.event)
        self.now = until
        return tuple(self.steps[before:])

    def _send(self, event: Event | None) -> Step:
        return self._keep(self.machine.send(event, self._situation()))

    def _situation(self) -> KnowledgeSituation:
        return KnowledgeSituation(self.knowledge, self.library, lambda: self.now)

    def _keep(self, step: Step) -> Step:
        self.steps.append(step)
        if step.knowledge:
            self.knowledge.apply(step.knowledge, CHART)
        for output in step.output:
            self._note(output)
        return step

    def _note(self, output: Output) -> None:
        match output:
            case Start():
                self.running.append(output)
                within = output.within or DEFAULT_WITHIN
                outcome = late(output, within)
                timeout = Event(outcome.event, outcome.attributes, to=output.activation)
                self._due.append(_Due(self.now + within, timeout, output.activation, output.action_id))
            case StartTimer(activation, index, seconds, name):
                timeout = Event(name, to=activation, exact=True, number=index)
                self._due.append(_Due(self.now + seconds, timeout, activation))
            case SendLater(event, seconds, name):
                self._due.append(_Due(self.now + seconds, event, sent=(event.frame, name)))
            case Revoke(frame, name):
                self._due = [due for due in self._due if due.sent != (frame, name)]
            case Cancel(activation):
                self.running = [start for start in self.running if start.activation != activation]
                self._due = [due for due in self._due if due.activation != activation]
            case SetParameter() | SwitchMode() | SendMessage() | SetWire() | Note():
                pass  # a dry run has no components

    def _end(self, action_id: str) -> None:
        self.running = [start for start in self.running if start.action_id != action_id]
        self._due = [due for due in self._due if due.action_id != action_id]


def _skill(start: Start) -> str:
    return f"{start.component}.{start.skill}"
