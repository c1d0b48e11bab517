"""The arm of any robot: typed skills on joints and tool, with limits and speeds from the profile (S2.15)."""

from __future__ import annotations

from collections.abc import Mapping

from domains.arm_skills.driver import JointDriver
from domains.arm_skills.kinematics import Chain
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.declarations import Parameter
from dsc.components.parameters import ParameterValues, parameters_of
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Delta, fact
from knowledge_base.language.checking.inputs import require_methods


class Reached(Outcome):
    """All joints have arrived."""


class OutOfRange(Outcome):
    """The angle of a joint is outside of its limits."""

    joint: str
    least: float
    most: float


class OutOfReach(Outcome):
    """No angles within the limits bring the tool to the point."""


class Blocked(Outcome):
    """A joint cannot move further; the arm has stopped."""

    joint: str


class Arm(Component):
    """An arm with any number of joints.

    Its parameters are `pace`, from 0.05 to 1, and for each joint, e.g. `elbow`: `elbow_least`, `elbow_most` and
    `elbow_speed`. A profile sets them.

    During a movement, the robot learns the angles: `(angle elbow)` is in degrees.

    Args:
        chain: the joints; their limits and speeds are the defaults of the parameters.
        driver: moves the joints.
    """

    name = "arm"
    domain = "(define (domain arm) (:types joint) (:functions (angle ?j - joint) - number))"

    def __init__(self, chain: Chain, driver: JointDriver) -> None:
        super().__init__()
        self._chain = chain
        self._driver = require_methods(driver, JointDriver)
        declared = {"pace": Parameter("number", default=1.0, least=0.05, most=1.0)}
        for joint in chain.joints:
            declared[f"{joint.name}_least"] = Parameter("number", default=joint.least, changed_by="profile")
            declared[f"{joint.name}_most"] = Parameter("number", default=joint.most, changed_by="profile")
            declared[f"{joint.name}_speed"] = Parameter("number", default=joint.speed, least=1.0, changed_by="profile")
        relations = tuple([f"(< ?{joint.name}_least ?{joint.name}_most)" for joint in chain.joints])
        self.parameter_values = ParameterValues(self.name, parameters_of(declared, relations))
        self.parameters = self.parameter_values.parameters

    @skill
    async def move_joints(self, call: SkillCall, targets: dict[str, float]) -> Reached | OutOfRange | Blocked:
        """Move joints by name to angles in degrees; all of them arrive together."""
        return await self._move(call, targets)

    @skill
    async def take_pose(self, call: SkillCall, pose: str) -> Reached | OutOfRange | Blocked:
        """Move joints to a pose as a profile writes it: `shoulder 80, elbow -20`."""
        return await self._move(call, self._angles_of(pose))

    @skill
    async def move_tool(self, call: SkillCall, x: float, y: float) -> Reached | OutOfReach | Blocked:
        """Move the tool to a point in metres."""
        limits = {joint.name: self._limits(joint.name) for joint in self._chain.joints}
        angles = self._chain.angles_for((x, y), self._driver.angles(), limits)
        if angles is None:
            return OutOfReach()
        moved = await self._move(call, angles)
        assert not isinstance(moved, OutOfRange)  # noqa: S101  # the angles are within the limits
        return moved

    async def _move(self, call: SkillCall, targets: Mapping[str, float]) -> Reached | OutOfRange | Blocked:
        now = self._driver.angles()
        for name, angle in targets.items():
            if name not in now:
                raise UnknownNameError(f"the arm has no joint '{name}'", found=name, valid=now)
            least, most = self._limits(name)
            if not least <= angle <= most:
                return OutOfRange(joint=name, least=least, most=most)
        pace = self.parameters["pace"]
        seconds = max(
            (abs(angle - now[name]) / (pace * self.parameters[f"{name}_speed"]) for name, angle in targets.items()),
            default=0.0,
        )
        blocked = await self._driver.move(call, targets, seconds, lambda: call.observe(self._angles()))
        if blocked is not None and blocked not in now:
            raise UnknownNameError(f"the driver reports a joint '{blocked}'", found=blocked, valid=now)
        observed = self._angles()
        return Reached(observed=observed) if blocked is None else Blocked(joint=blocked, observed=observed)

    def _angles(self) -> Delta:
        """Return the present angles as knowledge."""
        angles = self._driver.angles()
        values = {fact("angle", name): round(angle, 3) for name, angle in angles.items()}
        return Delta(nodes=dict.fromkeys(angles, "joint"), values=values)

    def _limits(self, joint: str) -> tuple[float, float]:
        return self.parameters[f"{joint}_least"], self.parameters[f"{joint}_most"]

    def _angles_of(self, pose: str) -> dict[str, float]:
        """Return the angles of a pose; raise `InputError` for a text of another form."""
        angles = {}
        for part in pose.split(","):
            match part.split():
                case [name, angle]:
                    try:
                        angles[name] = float(angle)
                    except ValueError:
                        raise InputError(f"the angle of '{name}' is a number, not '{angle}'", found=angle) from None
                case _:
                    raise InputError(f"a pose is written 'shoulder 80, elbow -20', not '{pose}'", found=pose)
        return angles
