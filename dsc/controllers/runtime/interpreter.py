"""Interpreter of the tables of a plot; part of each Python controller, as `runtime.c` is part of each C file.

The interpreter executes the algorithm of SCXML 1.0, appendix D, as `dsc.engine` does.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

from dsc.controllers.runtime.microsteps import Microsteps
from dsc.controllers.runtime.tables import (
    AT_LEAST,
    EVERY,
    MAX_EVENTS,
    MAX_NOW,
    NO_DATA,
    WITHIN,
    Host,
    Occurrence,
    Status,
)
from dsc.controllers.runtime.values import INT64_MAX, INT64_MIN, OVERFLOW, Failure

_WORDS = {int: "an integer", float: "a number", bool: "true or false"}


class Interpreter(Microsteps):
    """A controller; `init` enters the initial states, `post` and `end` bring events, `step` handles them."""

    def fill(self, **parameters: Any) -> Failure | None:
        """Set the parameters and initial values."""
        raise NotImplementedError

    def init(self, host: Host, now_ns: int = 0, **parameters: Any) -> Status:
        """Enter the initial states; the status has `FAILED` if a parameter or an initial value does not fit.

        Raise `ValueError` for a parameter that is unknown, or that is missing and has no default.
        """
        self._check_now(now_ns)
        for name in (*parameters, *self.parameters):
            if name not in self.parameters:
                raise ValueError(f"there is no parameter {name!r}; the parameters are {[*self.parameters]}")
            if name not in parameters and not self.parameters[name]:
                raise ValueError(f"the parameter {name!r} has no default: pass it to `init`")
        self.reset()
        self.host, self.clock, self.begun = host, now_ns, True
        failure = self.fill(**parameters)
        if failure is not None:
            self.ended = True
            return Status.FAILED | (Status.OVERFLOW if failure is OVERFLOW else Status.OK)
        self._begin()
        self._enter(0, (self.nodes[0].initial,))
        self._rest()
        self._finish()
        return self.status

    def post(self, event: int, data: Mapping[str, Any] = NO_DATA) -> Status:
        """Queue an event; raise `ValueError` for data that the chart does not know."""
        return self._queue(event, 0, data)

    def end(self, run: int, event: int, data: Mapping[str, Any] = NO_DATA) -> Status:
        """Queue the outcome of the activity that was started with this `run`; errors as for `post`."""
        return self._queue(event, run, data)

    def step(self, now_ns: int) -> Status:
        """Handle the timers due until `now_ns`, in order, then the queued events."""
        self._require_init()
        self._check_now(now_ns)
        self.status = Status.OK
        for _ in range(MAX_EVENTS):
            if self.ended:
                return self.status
            timer = self._next_due(now_ns)
            if timer >= 0:
                self._time_out(timer)
                continue
            self.clock = max(self.clock, now_ns)
            if not self.queue:
                return self.status
            self._handle(self.queue.popleft())
        if not self.ended and (self.queue or self._next_due(now_ns) >= 0):
            self.status |= Status.BUSY
        return self.status

    def configuration(self) -> list[int]:
        """Return the active states, outer states first."""
        return [index for index, node in enumerate(self.nodes) if self.active[index] and node.state]

    def _queue(self, event: int, run: int, data: Mapping[str, Any]) -> Status:
        self._require_init()
        if not isinstance(event, int):
            raise ValueError(f"an event is one of `Events`, not {event!r}")
        data = self._convert(data)
        if self.ended or not self.first_event <= event < len(self.event_names) or not all(map(isfinite, data.values())):
            return Status.UNKNOWN
        if len(self.queue) >= self.queue_capacity:
            self.dropped += 1
            return Status.FULL
        self.queue.append(Occurrence(event, data, run=run))
        return Status.OK

    def _require_init(self) -> None:
        if not self.begun:
            raise ValueError("call `init` before `step`, `post`, `end` and `cycle`")

    def _check_now(self, now_ns: int) -> None:
        if type(now_ns) is not int or abs(now_ns) > MAX_NOW:
            raise ValueError(f"the time is an integer of nanoseconds from -2**62 to 2**62, not {now_ns!r}")

    def _convert(self, data: Mapping[str, Any]) -> Mapping[str, Any]:
        for name, value in data.items():
            if name not in self.attributes:
                raise ValueError(f"there is no attribute {name!r}; the attributes are {[*self.attributes]}")
            wanted: Any = self.attributes[name]
            if type(value) is not wanted and not (wanted is float and type(value) is int):
                raise ValueError(f"{name!r} is {_WORDS[wanted]}, not {value!r}")
            if wanted is int and not INT64_MIN <= value <= INT64_MAX:
                raise ValueError(f"'{name}' has more than 64 bits: {value}")
        return {name: self.attributes[name](value) for name, value in data.items()}

    def _handle(self, occurrence: Occurrence) -> None:
        if occurrence.run == 0:
            self._begin()
            self._take(occurrence)
            self._rest()
            self._finish()
            return
        activity = next((one for one, run in self.running.items() if run == occurrence.run), -1)
        if activity >= 0:
            self._end_activity(activity, occurrence)

    def _end_activity(self, activity: int, occurrence: Occurrence) -> None:
        """Handle the outcome of an activity; an outcome that an active state ignores ends the controller."""
        del self.running[activity]
        node = self.activities[activity].node
        self.due.pop(self.activities[activity].timer, None)
        occurrence = occurrence._replace(node=node, serial=self.serial[node])
        self._begin()
        handled = self._take(occurrence)
        self._rest()
        if not handled and self.active[node] and self.serial[node] == occurrence.serial:
            self.failed = True
        self._finish()

    def _begin(self) -> None:
        self.macrostep += 1
        self.microsteps = 0

    def _finish(self) -> None:
        """End the controller if its plot has ended, or after a failure that nothing handles."""
        if self.failed and not self.finished:
            self.event = NO_DATA
            self.internal.clear()
        if self.failed or self.finished:
            self._exit([*self.active], [False] * len(self.nodes))
            errors = any(one.event in self.error_events for one in self.internal)
            if self.failed or (errors and not self.scxml):
                self.status |= Status.FAILED
            self.ended = True

    def _rest(self) -> None:
        """Take transitions without trigger, then handle internal events, until neither is left."""
        while not self.finished:
            if self._react(None):
                continue
            if not self.internal:
                return
            occurrence = self.internal.popleft()
            if not self._take(occurrence) and occurrence.event in self.error_events and not self.scxml:
                self.failed = True

    def _take(self, occurrence: Occurrence) -> bool:
        self.event = occurrence.data
        if occurrence.event not in self.error_events:
            self.turn += 1
        node = occurrence.node
        if node >= 0 and not (self.active[node] and self.serial[node] == occurrence.serial):
            return False
        return self._react(occurrence)

    def _next_due(self, now_ns: int) -> int:
        first = min(self.due, key=lambda timer: self.due[timer], default=-1)
        return first if first >= 0 and self.due[first][0] <= now_ns else -1

    def _time_out(self, number: int) -> None:
        kind, node, target = self.timers[number]
        self.clock = max(self.clock, self.due.pop(number)[0])
        if kind == WITHIN:
            self.host.stop(target, self.running[target])
            self._end_activity(target, Occurrence(self.timed_out))
            return
        serial = self.serial[node]
        self._begin()
        if kind == AT_LEAST:
            self._enable(node)
        else:
            self._take(Occurrence(0, NO_DATA, node, serial, exact=True, edge=target, periodic=kind == EVERY))
        if kind == EVERY and self.active[node] and self.serial[node] == serial:
            self._arm(number)
        self._rest()
        self._finish()

    def _enable(self, node: int) -> None:
        """Enable the transitions of a state whose least time has passed; first offer the state its kept events."""
        self.event = NO_DATA
        self.turn += 1
        self.waiting[node] = False
        for one in self.kept:
            if one.node == node:
                self._fire(one)
        self._forget(node)
