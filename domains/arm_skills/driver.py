"""The driver of an arm's joints: the only part that a new robot implements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from dsc.calls import SkillCall


class JointDriver(Protocol):
    """The joints of one arm, e.g. of a real arm, or of a kinematic simulation."""

    def angles(self) -> Mapping[str, float]:
        """Return the present angles in degrees, by joint."""
        ...

    async def move(
        self, call: SkillCall, targets: Mapping[str, float], seconds: float, moved: Callable[[], None]
    ) -> str | None:
        """Move joints so that all of them arrive after that time.

        A cancelled movement ends at the present angles.

        Args:
            call: the execution of the skill; its clock is the clock of the movement.
            targets: angles in degrees, within the limits.
            seconds: the duration, so that no joint is too fast.
            moved: is called during the movement, as often as the driver has new angles.

        Returns:
            The name of a joint that is blocked; `None` if all joints have arrived.

        Raises:
            SkillError: the device has failed.
        """
        ...
