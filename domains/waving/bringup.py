"""Waving as a bundle: one plot, two simulated arms, and any arm with a driver (S2.25)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, ClassVar

from domains.arm_skills.arm import Arm
from domains.arm_skills.bringup import NAME as ARM_SKILLS
from domains.arm_skills.kinematics import Chain, Joint
from domains.arm_skills.simulated_joints import SimulatedJoints
from dsc.components.component import Component
from planning.robot.bundles import Bundle
from planning.robot.simulation import Setup, Simulation

HOME = Path(str(files("domains.waving")))
NAME = "waving"
BLOCKED = "blocked"


class DeskArm(Simulation):
    """A kinematic simulation of an arm with five joints on a desk.

    Attributes:
        chain: the joints.
        start: the angles at the start, in degrees.
    """

    chain: ClassVar[Chain] = Chain(
        [
            Joint("base", 0.15, 60, 120, 40),
            Joint("shoulder", 0.25, -120, 120, 60),
            Joint("elbow", 0.22, -140, 140, 80),
            Joint("wrist", 0.12, -100, 100, 120),
            Joint("hand", 0.10, -90, 90, 180),
        ]
    )
    start: ClassVar[Mapping[str, float]] = {"base": 90, "shoulder": -60, "elbow": -60, "wrist": 0, "hand": 0}

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.joints = SimulatedJoints(self.chain, self.start, lambda action: self.fault(action, BLOCKED) is not None)

    def components(self) -> Iterable[Component]:
        """Return the arm."""
        return [Arm(self.chain, self.joints)]

    def scene(self) -> list[dict[str, Any]]:
        """Return the links of the arm."""
        return self.joints.scene()


class HumanoidArm(DeskArm):
    """A kinematic simulation of the right arm of a humanoid, with three joints."""

    chain = Chain(
        [
            Joint("shoulder", 0.32, -95, 120, 45),
            Joint("elbow", 0.28, 0, 145, 60),
            Joint("wrist", 0.18, -60, 60, 90),
        ],
        base=(0.0, 1.4),
    )
    start = {"shoulder": -80, "elbow": 5, "wrist": 0}  # noqa: RUF012  # declared by the base class


def bundle() -> Bundle:
    """Return the bundle; `wave` is its main plot."""
    return Bundle.in_folder(
        HOME,
        name=NAME,
        about="wave with any arm: one plot, two arms in a kinematic simulation",
        needs=(ARM_SKILLS,),
        main="wave",
        failures=("did_not_wave",),
        simulation=DeskArm,
        robots={"desk_arm": DeskArm, "humanoid": HumanoidArm},
    )
