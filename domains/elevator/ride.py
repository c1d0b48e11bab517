"""The state of a ride: the place of the robot and the executed actions, in a file next to the store of the run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from domains.elevator.lift import LIFT, Lift, Stop


class Ride:
    """The robot and the lift.

    Args:
        lift: the lift.
        place: the floor at which the robot waits.
        mishap: returns the kind of the mishap that hits an action, one of the given kinds, or `None`.

    Attributes:
        place: the floor of the robot, or `lift`.
        second: the second of the last action or perception.
        done: the ids of executed actions, with their results.
    """

    def __init__(self, lift: Lift, place: str, mishap: Callable[..., str | None]) -> None:
        self.lift = lift
        self.place = place
        self.mishap = mishap
        self.second = 0.0
        self.done: dict[str, str | None] = {}
        self._file: Path | None = None

    def keep(self, file: Path) -> None:
        """Write the state to a file now, and after each action."""
        self._file = file
        self._write()

    def resume(self, file: Path) -> None:
        """Read the state from a file, and keep it there."""
        self._file = file
        self.place, self.done = json.loads(file.read_text("utf-8"))

    def move(self, action: str, to: str | None, refusal: str | None = None) -> str | None:
        """Move the robot, unless this action has ended before; return its refusal, or `None`."""
        if action not in self.done:
            self.done[action] = refusal
            self.place = to or self.place
            self._write()
        return self.done[action]

    def visible_stop(self, second: float) -> Stop | None:
        """Return the stop whose open door the robot sees, from inside or from the floor."""
        self.second = second
        stop = self.lift.open_stop(second)
        if stop is None or self.place not in (LIFT, stop.floor):
            return None
        return None if self.mishap(f"stop {stop.number}", "stuck") else stop

    def persons(self, second: float) -> tuple[str, ...]:
        """Return the persons in the lift, as the robot sees them."""
        stop = self.lift.last_stop(second)
        return stop.persons if stop is not None and self.place == LIFT else ()

    def _write(self) -> None:
        if self._file is not None:
            new = self._file.with_name(f"{self._file.name}.new")  # a crash leaves the old or the new state
            new.write_text(json.dumps([self.place, self.done]), "utf-8")
            new.replace(self._file)
