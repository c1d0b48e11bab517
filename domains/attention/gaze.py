"""The gaze of a robot: a component that turns a camera to objects (S4.5)."""

from __future__ import annotations

from typing import Protocol

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.language.checking.inputs import require_methods


class GazeDriver(Protocol):
    """The joints of a camera or a head."""

    async def turn_to(self, call: SkillCall, what: str) -> str | None:
        """Turn to an object; return the reason why it is not visible, or `None`.

        Raises:
            SkillError: the device has failed.
        """
        ...


class Turned(Outcome):
    """The camera looks at the object."""


class NotVisible(Outcome):
    """The camera cannot look at the object, and the reason."""

    reason: str


class Attention(Component):
    """The camera of a robot; its plot is `serve_attention`.

    Args:
        driver: turns the camera.
    """

    name = "attention"

    def __init__(self, driver: GazeDriver) -> None:
        super().__init__()
        self._driver = require_methods(driver, GazeDriver)

    @skill(after_crash="repeat")
    async def turn_to(self, call: SkillCall, what: str) -> Turned | NotVisible:
        """Turn the camera to an object."""
        reason = await self._driver.turn_to(call, what)
        return Turned() if reason is None else NotVisible(reason=reason)
