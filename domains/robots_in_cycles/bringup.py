"""The two robots as bundles: `dsc run line-follower` and `dsc run obstacle-avoider` (S3.4)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from domains.robots_in_cycles.drives import CYCLE, HOME, Course, LineCourse, RoomCourse
from domains.robots_in_cycles.film import Film
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.sequencer.run_end import RunEnd
from dsc.skills import skill
from dsc.text.plot_files import load_plot
from knowledge_base.errors import InputError
from knowledge_base.store import KnowledgeBase
from planning.robot.bundles import Bundle
from planning.robot.simulation import Left, Setup, Simulation


class Driven(Outcome):
    """The end of a drive."""


class CannotDrive(Outcome):
    """There is no drive: something is missing on this machine, the film cannot be made, or the plot has a mistake."""

    reason: str


class Rovers(Component):
    """The component of both robots, which simulates a drive cycle by cycle."""

    name = "rover"

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._seed = seed
        self.course: Course | None = None

    @skill
    async def follow_line(self, call: SkillCall, seconds: float, track: int, film: str) -> Driven | CannotDrive:
        """Follow the line of a track; `film` is the file of a film, or empty."""
        return await self._drive(call, seconds, film, lambda: LineCourse(track, self._seed))

    @skill
    async def avoid_obstacles(self, call: SkillCall, seconds: float, film: str) -> Driven | CannotDrive:
        """Drive through the room whose pillars follow from the seed; `film` is the file of a film, or empty."""
        return await self._drive(call, seconds, film, lambda: RoomCourse(self._seed))

    async def _drive(
        self, call: SkillCall, seconds: float, film: str, start: Callable[[], Course]
    ) -> Driven | CannotDrive:
        try:
            shown = Film(Path(film), seconds) if film else None
            self.course = start()
            while self.course.rover.seconds < seconds:
                self.course.advance()
                if shown is not None:
                    shown.watch(self.course)
                await call.clock.sleep(CYCLE)
            if shown is not None:
                shown.save()
        except InputError as error:
            return CannotDrive(reason=str(error))
        return Driven()


class Tracks(Simulation):
    """A world in MuJoCo with one of the two robots; the seed gives headings, noise and pillars."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._rover = Rovers(self.seed)

    def components(self) -> Iterable[Component]:
        """Return the robot."""
        return [self._rover]

    def left(self) -> Sequence[Left] | None:
        """Return the contacts; `None` before a drive."""
        course = self._rover.course
        if course is None:
            return None
        drive = course.drive
        return [Left("a drive without contact", reason=f"{drive.contacts} contacts")] if drive.contacts else []

    def own_report(self, knowledge: KnowledgeBase, end: RunEnd) -> Mapping[str, Any]:
        """Return laps, mean distance from the line, contacts, and the length of the path."""
        del knowledge, end
        course = self._rover.course
        if course is None:
            return {}
        drive = course.drive
        values = {"laps": drive.laps, "distance_m": drive.distance, "contacts": drive.contacts, "metres": drive.metres}
        return {name: round(value, 4) for name, value in values.items()}

    def headline(self, own: Mapping[str, Any], *, reached: bool) -> str | None:
        """Return the figures of the drive."""
        del reached
        if not own:
            return None
        line = f"{own['laps']:.2f} laps, {own['distance_m'] * 1000:.1f} mm from the line, " if own["laps"] else ""
        return f"The robot drove {own['metres']:.1f} m: {line}{own['contacts']} contacts"


def _bundle(name: str, plot: str, about: str) -> Bundle:
    plots, failures = (load_plot(HOME / f"{plot}.yaml"),), ("did_not_drive",)
    return Bundle(name, plots=plots, about=about, main=plot, simulation=Tracks, failures=failures)


def line_follower() -> Bundle:
    """Return the bundle of the line follower."""
    return _bundle(
        "line-follower", "line_follower", "follow a line in MuJoCo: a plot sets the motors in cycles of 32 ms"
    )


def obstacle_avoider() -> Bundle:
    """Return the bundle of the obstacle avoider."""
    about = "drive between pillars in MuJoCo: a plot sets the motors in cycles of 32 ms"
    return _bundle("obstacle-avoider", "obstacle_avoider", about)
