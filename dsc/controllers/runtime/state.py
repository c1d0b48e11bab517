"""State of a controller, its internal events and timers; part of each Python controller."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from dsc.controllers.runtime.tables import (
    ERROR_EVENT,
    EVERY,
    MAX_SECONDS,
    NO_DATA,
    SHORTEST_PERIOD,
    Activity,
    Edge,
    Host,
    Node,
    Occurrence,
    Status,
    Timer,
)
from dsc.controllers.runtime.values import ERROR, OVERFLOW, Failure


class ControllerState:
    """The tables of a plot, and the state of one controller."""

    nodes: ClassVar[tuple[Node, ...]]
    edges: ClassVar[tuple[Edge, ...]]
    timers: ClassVar[tuple[Timer, ...]]
    activities: ClassVar[tuple[Activity, ...]]
    event_names: ClassVar[tuple[str, ...]]
    first_event: ClassVar[int]
    error_events: ClassVar[frozenset[int]]
    timed_out: ClassVar[int]
    attributes: ClassVar[Mapping[str, type]]
    parameters: ClassVar[Mapping[str, bool]]
    scxml: ClassVar[bool]
    queue_capacity: ClassVar[int] = 16
    internal_capacity: ClassVar[int] = 64
    guards: ClassVar[tuple[Callable[[Any], bool | Failure], ...]]
    blocks: ClassVar[tuple[Callable[[Any], None], ...]]
    seconds: ClassVar[tuple[Callable[[Any], float | Failure], ...]]

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything, as before `init`."""
        size = len(self.nodes)
        self.host, self.clock, self.status = Host(), 0, Status.OK
        self.active, self.waiting, self.serial = [False] * size, [False] * size, [0] * size
        self.memory: dict[int, list[int]] = {}
        self.due: dict[int, tuple[int, int]] = {}
        self.running: dict[int, int] = {}
        self.marks = [-1] * len(self.edges)
        self.queue: deque[Occurrence] = deque()
        self.internal: deque[Occurrence] = deque()
        self.kept: list[Occurrence] = []
        self.event: Mapping[str, Any] = NO_DATA
        self.turn = self.macrostep = self.microsteps = self.runs = self.armed = self.dropped = self.lost = 0
        self.begun = self.ended = self.finished = self.failed = self.cycled = False

    def _fire(self, occurrence: Occurrence) -> None:
        if len(self.internal) >= self.internal_capacity:
            self.lost += 1
            self.status |= Status.LOST
        else:
            self.internal.append(occurrence)

    def _fail(self, failure: Failure) -> None:
        if failure is OVERFLOW:
            self.status |= Status.OVERFLOW
        self._fire(Occurrence(ERROR_EVENT))

    def _start(self, activity: int, arguments: Mapping[str, Any]) -> None:
        self.runs += 1
        self.running[activity] = self.runs
        if self.activities[activity].timer >= 0:
            self._arm(self.activities[activity].timer)
        self.host.start(activity, self.runs, arguments)

    def _arm(self, timer: int) -> None:
        seconds = self.seconds[timer](self)
        least = SHORTEST_PERIOD if self.timers[timer].kind == EVERY else 0
        if isinstance(seconds, Failure):
            self._fail(seconds)
        elif seconds < least:
            self._fail(ERROR)
        elif seconds < MAX_SECONDS:
            self.armed += 1
            self.due[timer] = (self.clock + int(seconds * 1e9 + 0.5), self.armed)

    def _forget(self, node: int) -> None:
        self.kept = [one for one in self.kept if one.node != node]

    def _keep(self, occurrence: Occurrence, node: int) -> None:
        if len(self.kept) >= self.queue_capacity:
            self.lost += 1
            self.status |= Status.LOST
        else:
            self.kept.append(occurrence._replace(node=node, serial=self.serial[node], exact=True))
