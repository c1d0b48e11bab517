"""Record of a macrostep in progress."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from dsc.engine.machine_state import NOTHING
from dsc.engine.steps import NO_CHANGE, DecisionMade, Microstep, Output, PlotBound, Taken
from dsc.events import Event


class MacrostepRecord:
    """Collects the contents of the step.

    Attributes:
        serials: the last serial number given out.
        internal: pending internal events.
        outputs: values that the outermost plot returns, once it has reached its end.
        exited, entered, bound: changes of the current microstep.
    """

    __slots__ = (
        "bound", "decisions", "emitted", "entered", "errors", "exited", "internal", "knowledge", "microsteps",
        "output", "outputs", "serials",
    )  # fmt: skip

    def __init__(self, serials: int) -> None:
        self.serials = serials
        self.internal: deque[Event] = deque()
        self.microsteps: list[Microstep] = []
        self.decisions: list[DecisionMade] = []
        self.output: list[Output] = []
        self.emitted: list[Event] = []
        self.errors: list[str] = []
        self.knowledge = NO_CHANGE
        self.outputs: Mapping[str, Any] = NOTHING
        self.exited: list[str] = []
        self.entered: list[str] = []
        self.bound: list[PlotBound] = []

    def next_serial(self) -> int:
        """Return a number never given out before in this run."""
        self.serials += 1
        return self.serials

    def end_microstep(self, event: Event | None, taken: tuple[Taken, ...]) -> None:
        """Close a microstep: the exits, entries and bindings since the last one."""
        bound = tuple(self.bound)
        self.microsteps.append(Microstep(event, taken, tuple(self.exited), tuple(self.entered), bound))
        self.exited, self.entered, self.bound = [], [], []
