"""A simulated lift with persons, as functions of time: a resumed run meets the same stops and persons."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from domains.elevator.floors import FLOORS
from dsc.chance import choose, uniform

NAMES = tuple(FLOORS)
"""The names of the floors, from below."""
LIFT = "lift"
"""The place of the robot in the lift."""
PERSONS = ("anna", "bert", "cleo", "dora", "emil")
OPEN = 25.0
"""Seconds for which the door is open."""
TRAVEL = 5.0
"""Seconds of a ride, for each floor."""
_BOARDING = 0.3
_LEAVING = 0.3


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop of the lift.

    Attributes:
        number: the number of the stop, from 0.
        floor: the floor.
        opens: second at which the door opens.
        persons: the persons in the lift while the door is open, after the others have left.
    """

    number: int
    floor: str
    opens: float
    persons: tuple[str, ...]

    @property
    def closes(self) -> float:
        """Second at which the door closes."""
        return self.opens + OPEN


class Lift:
    """The timetable of a lift.

    Args:
        seed: determines the floors and the persons.
        persons: the persons who take the lift; it stays empty without any.
    """

    def __init__(self, seed: int, persons: tuple[str, ...] = PERSONS) -> None:
        self._seed = seed
        self._persons = persons
        self._stops = [Stop(0, NAMES[0], 4.0, persons[:2])]

    def last_stop(self, second: float) -> Stop | None:
        """Return the last stop whose door has opened; `None` before the first one."""
        while self._stops[-1].closes < second:
            self._stops.append(self._after(self._stops[-1]))
        return next((stop for stop in reversed(self._stops) if stop.opens <= second), None)

    def open_stop(self, second: float) -> Stop | None:
        """Return the stop at which the door is open."""
        stop = self.last_stop(second)
        return stop if stop is not None and second < stop.closes else None

    def next_change(self, second: float) -> float:
        """Return the next second at which the door opens or closes."""
        stop = self.last_stop(second)
        if stop is None:
            return self._stops[0].opens
        return stop.closes if second < stop.closes else self._after(stop).opens

    def _after(self, stop: Stop) -> Stop:
        number = stop.number + 1
        others = [floor for floor in NAMES if floor != stop.floor]
        floor = choose(self._seed, f"stop {number}", "floor", others)
        ride = TRAVEL * abs(NAMES.index(floor) - NAMES.index(stop.floor))
        return Stop(number, floor, stop.closes + ride, tuple(self._riders(stop, number)))

    def _riders(self, stop: Stop, number: int) -> Iterator[str]:
        for name in self._persons:
            chance = uniform(self._seed, f"stop {number}", name)
            if chance >= _LEAVING if name in stop.persons else chance < _BOARDING:
                yield name


def scene(lift: Lift, robot: str, second: float) -> list[dict[str, Any]]:
    """Return the floors, the cabin, the persons in it and the robot for the page.

    Args:
        lift: the lift.
        robot: the floor of the robot, or `lift`.
        second: the second of the run.
    """
    stop = lift.last_stop(second)
    level = FLOORS[NAMES[0] if stop is None else stop.floor].place[1]
    things: list[dict[str, Any]] = [
        {"id": name, "shape": "room", "x": 0.0, "y": floor.place[1], "label": name, "width": 3.0, "depth": 1.3}
        for name, floor in FLOORS.items()
    ]
    is_open = lift.open_stop(second) is not None
    label = "lift, open" if is_open else "lift, closed"
    things.append(
        {"id": "lift", "shape": "furniture", "x": 3.7, "y": level, "label": label, "width": 3.6, "depth": 1.3}
    )
    for number, name in enumerate(() if stop is None else stop.persons):
        things.append({"id": name, "shape": "operator", "x": 2.3 + 0.7 * number, "y": level + 0.25, "label": name})
    x, y = (2.6, level - 0.35) if robot == LIFT else FLOORS[robot].place
    return [*things, {"id": "robot", "shape": "robot", "label": "robot", "x": x, "y": y}]
