"""Drives of the two robots: the plot or another controller reads sensors and sets motors once a cycle of 32 ms."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
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


def plot_of(name: str) -> Step:
    """Return the cycle of a new controller with the plot of that name."""
    return CycleController(load_plot(HOME / "plots" / f"{name}.yaml")).step


def follow(track: int, seed: int, seconds: float, step: Step | None = None) -> Drive:
    """Return the drive of the line follower; the seed gives the heading at the start, and the noise.

    Args:
        track: a position in `TRACKS`.
        seed: the seed.
        seconds: the time of the drive.
        step: another controller instead of the plot.
    """
    line, fine = line_of(track), line_of(track, 4000)
    chance, step = random.Random(seed), step or plot_of("follow_line")  # noqa: S311  heading and noise
    rover = Rover(_segments(line), float(line[0][0]) - 0.005, -0.06, 90 + chance.uniform(-8, 8))
    path, off = [rover.position], []
    while rover.seconds < seconds:
        values = {name: _light(rover, aside, chance) for name, aside in (("left", 0.012), ("right", -0.012))}
        motors = step(values, rover.seconds)
        rover.drive(motors["left_wheel"], motors["right_wheel"], CYCLE)
        path.append(rover.position)
        off.append(float(np.min(np.linalg.norm(fine - rover.point(0.06), axis=1))))
    turned = np.unwrap([math.atan2(y, x) for x, y in path])
    return Drive(tuple(path), float(turned[-1] - turned[0]) / (2 * math.pi), sum(off) / len(off), rover.contacts)


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


def _light(rover: Rover, aside: float, chance: random.Random) -> float:
    dark = rover.below(0.06, aside).startswith("line")
    return min(1023.0, max(0.0, (300.0 if dark else 990.0) + chance.gauss(0, 8)))


def avoid(room: int, seconds: float, step: Step | None = None) -> Drive:
    """Return the drive of the obstacle avoider in a room whose pillars follow from its number.

    Args:
        room: the seed of the pillars and of the noise.
        seconds: the time of the drive.
        step: another controller instead of the plot.
    """
    chance, step = random.Random(room), step or plot_of("avoid_obstacles")  # noqa: S311  pillars and noise
    rover = Rover(_room(pillars_of(room)), 0.0, 0.0, chance.uniform(0, 360))
    path = [rover.position]
    while rover.seconds < seconds:
        seen = {name: rover.distance(angle, 2.0) for name, angle in DIRECTIONS.items()}
        values = {name: min(2.0, max(0.0, far + chance.gauss(0, 0.003))) for name, far in seen.items()}
        motors = step(values, rover.seconds)
        rover.drive(motors["left_wheel"], motors["right_wheel"], CYCLE)
        path.append(rover.position)
    return Drive(tuple(path), contacts=rover.contacts)


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
