"""The two robots as bundles: `dsc run line-follower` and `dsc run obstacle-avoider` (S3.4)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from domains.robots_in_cycles.drives import HOME, Drive, avoid, follow
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.sequencer.run_end import RunEnd
from dsc.skills import skill
from dsc.text.plot_files import load_plot
from knowledge_base.store import KnowledgeBase
from planning.robot.bundles import Bundle
from planning.robot.simulation import Left, Setup, Simulation


class Driven(Outcome):
    """The end of a drive."""


class Rovers(Component):
    """The component of both robots; a skill simulates a whole drive, then waits for its time."""

    name = "rover"

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._seed = seed
        self.drive: Drive | None = None

    @skill
    async def follow_line(self, call: SkillCall, seconds: float, track: int) -> Driven:
        """Follow the line of a track."""
        self.drive = follow(track, self._seed, seconds)
        return await self._wait(call, seconds)

    @skill
    async def avoid_obstacles(self, call: SkillCall, seconds: float) -> Driven:
        """Drive through the room whose pillars follow from the seed."""
        self.drive = avoid(self._seed, seconds)
        return await self._wait(call, seconds)

    async def _wait(self, call: SkillCall, seconds: float) -> Driven:
        await call.clock.sleep(seconds)
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
        drive = self._rover.drive
        if drive is None:
            return None
        return [Left("a drive without contact", reason=f"{drive.contacts} contacts")] if drive.contacts else []

    def own_report(self, knowledge: KnowledgeBase, end: RunEnd) -> Mapping[str, Any]:
        """Return laps, mean distance from the line, contacts, and the length of the path."""
        del knowledge, end
        drive = self._rover.drive
        if drive is None:
            return {}
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
    return Bundle(name, plots=(load_plot(HOME / f"{plot}.yaml"),), about=about, main=plot, simulation=Tracks)


def line_follower() -> Bundle:
    """Return the bundle of the line follower."""
    return _bundle(
        "line-follower", "line_follower", "follow a line in MuJoCo: a plot sets the motors in cycles of 32 ms"
    )


def obstacle_avoider() -> Bundle:
    """Return the bundle of the obstacle avoider."""
    about = "drive between pillars in MuJoCo: a plot sets the motors in cycles of 32 ms"
    return _bundle("obstacle-avoider", "obstacle_avoider", about)
