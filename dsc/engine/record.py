"""What a macrostep has done so far."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from dsc.engine.steps import Bound, DecisionMade, Microstep, Output, Taken
from dsc.events import Event
from knowledge_base.facts import Delta


@dataclass(slots=True)
class Record:
    """Collects what will be the step; `internal` are the events that the chart has still to take.

    Attributes:
        serials: the last serial number given out.
        exited, entered, bound: of the microstep that is going on.
    """

    serials: int = 0
    internal: deque[Event] = field(default_factory=deque)
    microsteps: list[Microstep] = field(default_factory=list)
    decisions: list[DecisionMade] = field(default_factory=list)
    output: list[Output] = field(default_factory=list)
    emitted: list[Event] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    knowledge: Delta = field(default_factory=Delta)
    exited: list[str] = field(default_factory=list)
    entered: list[str] = field(default_factory=list)
    bound: list[Bound] = field(default_factory=list)

    def next_serial(self) -> int:
        """A number never given out before in this run."""
        self.serials += 1
        return self.serials

    def end_microstep(self, event: Event | None, taken: tuple[Taken, ...]) -> None:
        """What was left, entered and bound since the last one becomes a microstep."""
        bound = tuple(self.bound)
        self.microsteps.append(Microstep(event, taken, tuple(self.exited), tuple(self.entered), bound))
        self.exited, self.entered, self.bound = [], [], []
