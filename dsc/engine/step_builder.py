"""Builder of a step: collects what a macrostep does."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from dsc.engine.machine_state import NOTHING, MachineState
from dsc.engine.situation import Decision
from dsc.engine.steps import NO_CHANGE, DecisionMade, Microstep, Output, PlotBound, Step
from dsc.engine.taken import Taken
from dsc.events import Event
from dsc.model.plot import ActionPlot
from knowledge_base.facts import Delta


class StepBuilder:
    """Collector of the results of a macrostep, with its serial numbers and its queue of internal events.

    The frequent operations are methods of the lists themselves, which saves a call each.

    Args:
        serials: the last serial number of the steps before.

    Attributes:
        serials: the last assigned serial number.
        internal: the queue of internal events, oldest first.
        microsteps: the microsteps that have ended, in order.
        exit, enter: record that a state, given by its path, was exited or entered in the current microstep.
        put: adds an external action, timer or note.
        fire: appends an internal event to the queue.
    """

    __slots__ = (
        "_bound", "_bugs", "_decisions", "_emitted", "_entered", "_errors", "_exited", "_knowledge", "_output", "enter",
        "exit", "fire", "internal", "microsteps", "put", "serials",
    )  # fmt: skip

    def __init__(self, serials: int) -> None:
        self.serials = serials
        self.microsteps: list[Microstep] = []
        self.internal: deque[Event] = deque()
        self._decisions: tuple[DecisionMade, ...] = ()
        self._output: list[Output] = []
        self._emitted: tuple[Event, ...] = ()
        self._errors: tuple[str, ...] = ()
        self._bugs: tuple[str, ...] = ()
        self._knowledge = NO_CHANGE
        self._exited: list[str] = []
        self._entered: list[str] = []
        self._bound: list[PlotBound] = []
        self.exit: Callable[[str], None] = self._exited.append
        self.enter: Callable[[str], None] = self._entered.append
        self.put: Callable[[Output], None] = self._output.append
        self.fire: Callable[[Event], None] = self.internal.append

    def number(self) -> int:
        """Return a new serial number."""
        self.serials += 1
        return self.serials

    # -- one microstep -----------------------------------------------------------------------------------

    def bind(self, path: str, plot: ActionPlot) -> None:
        """Record that a plot became the content of a state; the path of the outermost plot is empty."""
        self._bound.append(PlotBound(path, plot))

    def end_microstep(self, event: Event | None, taken: tuple[Taken, ...]) -> None:
        """Record a microstep with all exits, entries and bindings since the previous microstep."""
        bound = tuple(self._bound)
        self.microsteps.append(Microstep(event, taken, tuple(self._exited), tuple(self._entered), bound))
        self._exited.clear()
        self._entered.clear()
        self._bound.clear()

    def end_replacement(self) -> None:
        """Record a microstep without transitions if a plot was bound since the previous microstep."""
        if self._bound:
            self.end_microstep(None, ())

    # -- results -----------------------------------------------------------------------------------------

    def tell(self, change: Delta) -> None:
        """Add a change of the knowledge."""
        self._knowledge = self._knowledge.then(change)

    def emit(self, event: Event) -> None:
        """Add an outcome event of the outermost plot."""
        self._emitted += (event,)

    def decide(self, path: str, decision: Decision) -> None:
        """Add the decision on the content of a dynamic state."""
        self._decisions += (DecisionMade(path, decision),)

    def add_error(self, message: str) -> None:
        """Add the message of a failed action or guard for which no transition exists."""
        self._errors += (message,)

    def add_bug(self, message: str) -> None:
        """Add the message of failed user code for which no transition exists."""
        self._bugs += (message,)

    # -- the step ----------------------------------------------------------------------------------------

    def step(
        self, state: MachineState, event: Event | None, *, handled: bool, outputs: Mapping[str, Any] = NOTHING
    ) -> Step:
        """Return the step that leads to `state`; for the other arguments see `Step`."""
        return Step(
            state, event, handled, tuple(self.microsteps), self._decisions, self._knowledge, tuple(self._output),
            self._emitted, self._errors, outputs, self._bugs,
        )  # fmt: skip
