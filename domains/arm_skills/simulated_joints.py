"""A kinematic simulation of an arm: joints that move at their speeds, and may be blocked."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from domains.arm_skills.kinematics import Chain
from dsc.calls import SkillCall

_STEP = 0.1
"""Seconds between two positions of a movement, which the page draws."""


class SimulatedJoints:
    """A `JointDriver` that computes the angles.

    Args:
        chain: the joints.
        angles: the angles at the start.
        blocks: returns whether an action meets an obstacle; a blocked movement ends halfway.
    """

    def __init__(
        self, chain: Chain, angles: Mapping[str, float], blocks: Callable[[str], bool] = lambda _: False
    ) -> None:
        self.chain = chain
        self._angles = dict(angles)
        self._blocks = blocks

    def angles(self) -> Mapping[str, float]:
        """Return the present angles in degrees."""
        return dict(self._angles)

    async def move(
        self, call: SkillCall, targets: Mapping[str, float], seconds: float, moved: Callable[[], None]
    ) -> str | None:
        """Move the joints in straight lines; see `JointDriver`."""
        start = self.angles()
        steps = max(1, math.ceil(seconds / _STEP))
        blocked = self._blocks(call.action_id)
        for step in range(1, steps + 1):
            await call.clock.sleep(seconds / steps)
            part = step / steps
            if blocked and part > 0.5:
                return max(targets, key=lambda name: abs(targets[name] - start[name]))
            self._angles.update({name: start[name] + part * (end - start[name]) for name, end in targets.items()})
            moved()
        return None

    def scene(self) -> list[dict[str, Any]]:
        """Return the links and the tool for the page."""
        points = self.chain.points(self._angles)
        links = [
            {"id": joint.name, "shape": "link", "x": x, "y": y, "to_x": to_x, "to_y": to_y, "label": joint.name}
            for joint, (x, y), (to_x, to_y) in zip(self.chain.joints, points, points[1:], strict=False)
        ]
        x, y = points[-1]
        return [*links, {"id": "tool", "shape": "tool", "x": x, "y": y, "label": "tool"}]
