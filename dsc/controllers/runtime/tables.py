"""Tables and values of a controller; part of each Python controller."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntFlag
from typing import Any, NamedTuple

MAX_MICROSTEPS = 1000
"""Upper bound of microsteps for one event."""
MAX_EVENTS = 1000
"""Upper bound of events and timers that one call of `step` handles."""
MAX_SECONDS = 4e9
"""The time from which a timer is never due: nanoseconds have 64 bits."""
MAX_NOW = 2**62
"""The largest time of a cycle in nanoseconds."""
DONE_EVENT, ERROR_EVENT = 1, 2
AT_LEAST, AFTER, EVERY, WITHIN = range(4)
SHORTEST_PERIOD = 0.001
NO_DATA: Mapping[str, Any] = {}


class Status(IntFlag):
    """Result of a call; several bits may be set."""

    OK = 0
    FULL = 1  # the queue is full: the event is dropped, and counted in `dropped`
    UNKNOWN = 2  # the event or a number cannot be posted, or the controller has ended
    LOST = 4  # a queue of internal events is full: one is lost, and counted in `lost`
    OVERFLOW = 8  # an integer left the range of 64 bits, or is too large to be a double
    FAILED = 16  # no transition handles an error or an outcome: the controller has ended
    RUNAWAY = 32  # the chart goes round: the controller has ended
    BUSY = 64  # there is more to do: call `step` again


class Node(NamedTuple):
    """A state, a region, a history or, at index 0, the plot; blocks of actions have numbers, 0 is none."""

    name: str
    parent: int = -1
    last: int = 0
    initial: int = -1
    state: bool = True
    orthogonal: bool = False
    transparent: bool = False
    final: bool = False
    memory: int = -1
    deep: bool = False
    default: int = -1
    default_block: int = 0
    entry: int = 0
    leave: int = 0
    broken: int = 0
    outcome: int = 0
    waits: bool = False
    done: int = 0
    immediate: bool = False
    edges: tuple[tuple[int, int], ...] = ()
    timers: tuple[int, ...] = ()
    activities: tuple[int, ...] = ()


class Edge(NamedTuple):
    """A transition between nodes."""

    source: int
    targets: tuple[int, ...] = ()
    guard: int = 0
    effect: int = 0
    internal: bool = False
    each: bool = False
    cleared: tuple[int, ...] = ()


class Timer(NamedTuple):
    """A timer of a node; `number` is its edge, for `WITHIN` its activity."""

    kind: int
    node: int
    number: int = -1


class Activity(NamedTuple):
    """An activity of a node, with its timer of kind `WITHIN`."""

    name: str
    node: int
    timer: int = -1


class Occurrence(NamedTuple):
    """An event that waits to be handled; `run` is 0 except for the end of an activity."""

    event: int
    data: Mapping[str, Any] = NO_DATA
    node: int = -1
    serial: int = 0
    exact: bool = False
    edge: int = -1
    periodic: bool = False
    run: int = 0


class Host:
    """The program around a controller; a subclass overrides what it needs."""

    def start(self, activity: int, run: int, arguments: Mapping[str, Any]) -> None:
        """Start an activity; report its end with `end(run, event)`."""

    def stop(self, activity: int, run: int) -> None:
        """Stop an activity that has not ended."""

    def command(self, command: int, arguments: Mapping[str, Any]) -> None:
        """Execute a command."""

    def emit(self, event: int, data: Mapping[str, Any]) -> None:
        """Receive an outcome of the plot."""
