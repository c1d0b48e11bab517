"""The components that `TransportSuite` hosts: one with every kind of port, a publisher and a subscriber."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any, ClassVar, Never

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.ports import event, query, takes
from dsc.components.streams import Push, Stream
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.facts import Delta, fact


class There(Outcome):
    """The event `there`."""

    to: object


class Passed(Outcome):
    """The event `passed`."""

    n: float


class Doubled(Outcome):
    """The event `doubled`."""

    n: float


class Low(Outcome):
    """The event `low`."""

    level: float


class Measure(Outcome):
    """The event `measure`."""

    metres: float


class SuiteRobot(Component):
    """A component with every kind of port."""

    name = "robot"
    modes = ("scanning", "resting")
    needs: ClassVar[Mapping[str, tuple[str, ...]]] = {"scanning": ("power", "light"), "resting": ()}

    def __init__(self) -> None:
        super().__init__()
        self.log: list[Any] = []

    @skill
    async def go(self, call: SkillCall[Passed], to: str, steps: int = 3) -> There:
        """Report each step, and end at the destination."""
        self.log.append(f"go {to}")
        try:
            for n in range(steps):
                await call.clock.sleep(0.3)
                call.report(Passed(n=n))
        except asyncio.CancelledError:
            self.log.append("cancelled")
            raise
        return There(to=to, observed=Delta(added=(fact("at", to),)))

    @skill
    async def fall(self, call: SkillCall) -> Never:
        """Fail."""
        raise RuntimeError(f"{call.action_id} fell")

    @query
    async def doubled(self, n: float) -> Doubled:
        """Return the doubled number."""
        return Doubled(n=2 * n)

    @event
    def low(self, level: float, below: float = 20.0) -> Low | None:
        """Return the event's attributes if the level is low."""
        return Low(level=level) if level < below else None

    @takes
    async def say(self, text: str) -> None:
        """Record the text."""
        self.log.append(text)

    async def configure(self, parameter: str, value: object) -> None:
        """Record the setting."""
        self.log.append((parameter, value))


class Laser(Component):
    """A component that publishes values."""

    name = "laser"
    scan = Push({"metres": "number"})
    heat = Push({"celsius": "number"}, period=0.1)

    @query
    async def measure(self) -> Measure:
        """Return the published value."""
        return Measure(metres=9)


class Mapper(Component):
    """A component that subscribes to values."""

    name = "mapper"
    scan = Stream({"metres": "number"}, "laser.scan")
    heat = Stream({"celsius": "number"}, "laser.heat")
