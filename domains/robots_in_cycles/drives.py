"""Drives of the two robots: the plot or another controller reads sensors and sets motors once a cycle of 32 ms."""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domains.robots_in_cycles.rover import Rover
from dsc.cycles import CycleController
from dsc.text.plot_files import load_plot

CYCLE = 0.032
"""Seconds of a cycle."""
HOME = Path(str(files("domains.robots_in_cycles")))
TRACKS = ((0.9, 0.0, 2), (0.9, 0.15, 2), (1.0, 0.12, 3))
"""Tracks: mean radius in metres, relative amplitude and number of its waves around the centre."""
DIRECTIONS = {
    "left": 75, "half_left": 40, "near_left": 18, "front": 0, "near_right": -18, "half_right": -40, "right": -75,
}  # fmt: skip
"""Range finders with their directions, in degrees to the left."""
Step = Callable[[Mapping[str, float], float], Mapping[str, float]]
"""One cycle of a controller: values of sensors and the time, to values of motors."""


@dataclass(frozen=True, slots=True)
class Drive:
    """The result of a drive.

    Attributes:
        path: the places of the robot, one for each cycle, in metres.
        laps: the laps around the centre of a track.
        distance: the mean distance from the middle between the photo sensors to the line, in metres.
        contacts: the number of contacts with obstacles.
        metres: the length of the path.
    """

    path: tuple[tuple[float, float], ...]
    laps: float = 0.0
    distance: float = 0.0
    contacts: int = 0

    @property
    def metres(self) -> float:
        """The length of the path."""
        return sum(math.dist(one, other) for one, other in zip(self.path, self.path[1:], strict=False))


class Course(ABC):
    """A drive in progress.

    Args:
        rover: the robot at the start.
        chance: the noise of the sensors.
        plot: the name of the plot that is its controller.
        step: another controller instead of the plot.

    Attributes:
        rover: the robot.
    """

    def __init__(self, rover: Rover, chance: random.Random, plot: str, step: Step | None) -> None:
        self.rover, self._chance = rover, chance
        self._chart, self._other = controller_of(plot), step
        self._path = [rover.position]

    def advance(self) -> None:
        """Execute one cycle: sensors, controller, motors."""
        step: Step = self._other or self._chart.step
        motors = step(self._sensors(), self.rover.seconds)
        self.rover.drive(motors["left_wheel"], motors["right_wheel"], CYCLE)
        self._path.append(self.rover.position)

    @abstractmethod
    def _sensors(self) -> dict[str, float]: ...

    @property
    def states(self) -> list[str]:
        """The active states of the plot; none with another controller."""
        return [] if self._other else self._chart.active

    @property
    def drive(self) -> Drive:
        """The drive so far."""
        return Drive(tuple(self._path), contacts=self.rover.contacts)


class LineCourse(Course):
    """The line follower on a track; the seed gives the heading at the start, and the noise.

    Args:
        track: a position in `TRACKS`.
        seed: the seed.
        step: another controller instead of the plot.
    """

    def __init__(self, track: int, seed: int, step: Step | None = None) -> None:
        line, chance = line_of(track), random.Random(seed)  # noqa: S311  heading and noise
        rover = Rover(_segments(line), float(line[0][0]) - 0.005, -0.06, 90 + chance.uniform(-8, 8))
        super().__init__(rover, chance, "follow_line", step)
        self._line, self._off = line_of(track, 4000), list[float]()

    def advance(self) -> None:
        """Execute one cycle, and measure the distance from the line."""
        super().advance()
        self._off.append(float(np.min(np.linalg.norm(self._line - self.rover.point(0.06), axis=1))))

    def _sensors(self) -> dict[str, float]:
        return {"left": self._light(0.012), "right": self._light(-0.012)}

    def _light(self, aside: float) -> float:
        dark = self.rover.below(0.06, aside).startswith("line")
        return min(1023.0, max(0.0, (300.0 if dark else 990.0) + self._chance.gauss(0, 8)))

    @property
    def drive(self) -> Drive:
        """The drive so far."""
        turned = np.unwrap([math.atan2(y, x) for x, y in self._path])
        laps = float(turned[-1] - turned[0]) / (2 * math.pi)
        return replace(super().drive, laps=laps, distance=sum(self._off) / max(len(self._off), 1))


class RoomCourse(Course):
    """The obstacle avoider in a room whose pillars follow from its number.

    Args:
        room: the seed of the pillars and of the noise.
        step: another controller instead of the plot.
    """

    def __init__(self, room: int, step: Step | None = None) -> None:
        chance = random.Random(room)  # noqa: S311  noise
        rover = Rover(_room(pillars_of(room)), 0.0, 0.0, chance.uniform(0, 360))
        super().__init__(rover, chance, "avoid_obstacles", step)

    def _sensors(self) -> dict[str, float]:
        seen = {name: self.rover.distance(angle, 2.0) for name, angle in DIRECTIONS.items()}
        return {name: min(2.0, max(0.0, far + self._chance.gauss(0, 0.003))) for name, far in seen.items()}


def controller_of(name: str) -> CycleController:
    """Return a new controller with the plot of that name."""
    return CycleController(load_plot(HOME / "plots" / f"{name}.yaml"))


def follow(track: int, seed: int, seconds: float, step: Step | None = None) -> Drive:
    """Return the drive of the line follower during a time; see `LineCourse`."""
    return _complete(LineCourse(track, seed, step), seconds)


def avoid(room: int, seconds: float, step: Step | None = None) -> Drive:
    """Return the drive of the obstacle avoider during a time; see `RoomCourse`."""
    return _complete(RoomCourse(room, step), seconds)


def _complete(course: Course, seconds: float) -> Drive:
    while course.rover.seconds < seconds:
        course.advance()
    return course.drive


def line_of(track: int, points: int = 240) -> NDArray[np.float64]:
    """Return points of a track's line in equal angles around the centre."""
    radius, height, waves = TRACKS[track]
    angles = np.linspace(0, 2 * math.pi, points, endpoint=False)
    radii = radius * (1 + height * np.cos(waves * angles))
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def _segments(line: NDArray[np.float64]) -> str:
    made = []
    for number, (begin, end) in enumerate(zip(line, np.roll(line, -1, axis=0), strict=True)):
        (x, y), (way_x, way_y) = (begin + end) / 2, end - begin
        size, angle = f"{math.hypot(way_x, way_y) / 2 + 0.005} 0.02 0.0005", math.degrees(math.atan2(way_y, way_x))
        made.append(
            f'<geom name="line{number}" type="box" pos="{x} {y} 0.0005" size="{size}" euler="0 0 {angle}" '
            f'contype="0" conaffinity="0" rgba="0 0 0 1"/>'
        )
    return "".join(made)


def pillars_of(room: int) -> list[tuple[float, float]]:
    """Return the places of the pillars of a room; all have a free way around."""
    chance = random.Random(f"room {room}")  # noqa: S311  pillars
    placed: list[tuple[float, float]] = []
    while len(placed) < 6:
        one = (chance.uniform(-1.05, 1.05), chance.uniform(-1.05, 1.05))
        walls = 1.5 - max(map(abs, one))
        if math.hypot(*one) > 0.45 and walls > 0.4 and all(math.dist(one, other) > 0.5 for other in placed):
            placed.append(one)
    return placed


def _room(pillars: list[tuple[float, float]]) -> str:
    walls = (("1.55 0", "0.05 1.6"), ("-1.55 0", "0.05 1.6"), ("0 1.55", "1.6 0.05"), ("0 -1.55", "1.6 0.05"))
    boxes = [f'<geom type="box" pos="{at} 0.1" size="{size} 0.1"/>' for at, size in walls]
    return "".join([*boxes, *(f'<geom type="cylinder" pos="{x} {y} 0.1" size="0.08 0.1"/>' for x, y in pillars)])
