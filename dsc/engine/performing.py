"""Execution of actions in a running plot: variables, knowledge, events, and output to components."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

from dsc.engine.evaluation import delay_of, evaluate, output_of
from dsc.engine.frames import Frame
from dsc.engine.record import MacrostepRecord
from dsc.engine.situation import Situation
from dsc.engine.steps import Note, Revoke, SendLater, StartTimer
from dsc.engine.tables import StateNode
from dsc.events import AFTER, AT_LEAST, ERROR, EVERY, EXECUTION_ERROR, Event
from dsc.model.actions import Assign, Block, Choose, Emit, ExternalAction, Internal, Log, Tell, Withdraw
from dsc.model.language import TermField
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import Expression

Action = ExternalAction | Internal
_EXPONENT_FROM = 1e21
"""ECMAScript writes larger numbers with an exponent."""
SHORTEST_PERIOD = 0.001
"""Seconds; a shorter period would block all other events."""


class Performer(MacrostepRecord):
    """Executes actions.

    Attributes:
        situation: the world as the chart sees it.
        event: the last event taken; actions read its attributes.
    """

    __slots__ = ("event", "situation")

    def __init__(self, situation: Situation, serials: int) -> None:
        super().__init__(serials)
        self.situation = situation
        self.event: Event | None = None

    def holds(self, frame: Frame, condition: Expression) -> bool:
        """Return whether a condition is true in a frame; raise `InputError`."""
        return self.situation.holds(condition, self.bindings(frame))

    def value(self, frame: Frame, term: TermField) -> Any:
        """Return the value of a term in a frame; raise `InputError`."""
        return evaluate(term, self.bindings(frame), self.situation)

    def values(self, frame: Frame, terms: Mapping[str, TermField]) -> dict[str, Any]:
        """Return the values of several terms; raise `InputError`."""
        return {name: self.value(frame, term) for name, term in terms.items()}

    def bindings(self, frame: Frame) -> Mapping[str, Any]:
        """Return the frame's variables and the event's attributes."""
        if self.event is None or not self.event.attributes:
            return frame.variables
        return {**frame.variables, **self.event.bindings()}

    def fail(self, frame: Frame, reason: str) -> None:
        """Fire an `error` event in the plot for a failed evaluation."""
        name = EXECUTION_ERROR if frame.compiled.scxml else ERROR
        self.internal.append(Event(name, {"reason": reason}, frame=frame.serial))

    def act(self, frame: Frame, state: str, actions: Iterable[Action], activation: int = 0, first: int = 0) -> None:
        """Execute a block of actions of a state, numbered from `first` within its activation.

        An action that fails to evaluate fires an error. The other actions still run; in dialect `scxml` the rest of the
        block is skipped (SCXML 4.9). A branch condition that fails to evaluate is false (SCXML 5.9.1).
        """
        for number, action in enumerate(actions, first):
            try:
                if isinstance(action, Internal):
                    self._perform(frame, state, action)
                else:
                    value = partial(self.value, frame)
                    self.output.append(output_of(action, activation, number, value))
            except InputError as error:
                self.fail(frame, f"{frame.prefix}{state}: {error}")
                if frame.compiled.scxml:
                    return

    def start_timers(self, frame: Frame, node: StateNode, activation: int) -> None:
        """Start all timers of an entered state."""
        if node.at_least is not None:
            self.start_timer(frame, node, activation, AT_LEAST, 0, node.at_least)
        for index, timed in enumerate(node.timeouts):
            self.start_timer(frame, node, activation, AFTER, index, timed.seconds)
        for index, timed in enumerate(node.cycles):
            self.start_timer(frame, node, activation, EVERY, index, timed.seconds)

    def start_timer(
        self, frame: Frame, node: StateNode, activation: int, event: str, index: int, seconds: TermField
    ) -> None:
        """Start one timer of a state; a delay that fails to evaluate fires an error."""
        try:
            delay = delay_of(self.value(frame, seconds), least=SHORTEST_PERIOD if event == EVERY else 0)
        except InputError as error:
            self.fail(frame, f"{frame.prefix}{node.name}: {error}")
        else:
            self.output.append(StartTimer(activation, index, delay, event))

    def _perform(self, frame: Frame, state: str, action: Internal) -> None:
        match action:
            case Assign(assign=terms):
                frame.variables = {**frame.variables, **self.values(frame, terms)}
            case Tell(tell=effect):
                told = self.situation.tell(effect, self.bindings(frame))
                self.knowledge = self.knowledge.then(told)
            case Emit():
                attributes = self.values(frame, action.arguments)
                if action.delay is None:
                    self._emit(frame, action.emit, attributes)
                else:
                    self._emit_later(frame, action, action.delay, attributes)
            case Withdraw(withdraw=term):
                self.output.append(Revoke(frame.serial, str(self.value(frame, term))))
            case Log(log=parts, label=label):
                text = "".join(_shown(self.value(frame, part)) for part in parts)
                self.output.append(Note(label, text))
            case Choose():
                for inner in action.then if self._chooses(frame, state, action) else action.otherwise:
                    self._perform(frame, state, inner)
            case Block(block=inside):
                self.act(frame, state, inside)

    def _chooses(self, frame: Frame, state: str, action: Choose) -> bool:
        try:
            return self.holds(frame, action.condition)
        except InputError as error:
            self.fail(frame, f"condition of a branch in {frame.prefix}{state}: {error}")
            return False

    def _emit_later(self, frame: Frame, action: Emit, delay: TermField, attributes: Mapping[str, Any]) -> None:
        name = "" if action.id is None else str(self.value(frame, action.id))
        if action.into is not None:
            name = f"{action.emit}.{self.next_serial()}"
            frame.variables = {**frame.variables, action.into: name}
        event = Event(action.emit, attributes, frame=frame.serial)
        self.output.append(SendLater(event, delay_of(self.value(frame, delay)), name))

    def _emit(self, frame: Frame, name: str, attributes: Mapping[str, Any]) -> None:
        if name not in frame.compiled.plot.emits:
            self.internal.append(Event(name, attributes, frame=frame.serial))
        elif frame.parent is None:
            self.emitted.append(Event(name, attributes))
        elif not frame.gone:
            self.internal.append(Event(name, attributes, to=frame.parent.activations[frame.host]))
        # Otherwise another transition of this microstep exited the host, and the outcome is dropped.


def _shown(value: Any) -> str:
    """Return a value as ECMAScript prints it."""
    if value is None:
        return "undefined"
    if isinstance(value, bool):
        return str(value).lower()
    is_whole = isinstance(value, float) and value.is_integer() and abs(value) < _EXPONENT_FROM
    return f"{value:.0f}" if is_whole else str(value)
