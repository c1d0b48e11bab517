"""A second robot for the same table: a base on tracks, a suction arm, a camera that looks twice.

Its skills have the names and outcomes that the plots use, with other implementations; `vent` is its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar

from domains.clean_up_table.components import (
    Arm,
    Base,
    Camera,
    again,
    drives,
    outcome_of,
    picks_up,
    recognises,
    seconds,
    takes_out,
)
from domains.clean_up_table.places import PLACES, distance
from dsc.calls import Outcome, SkillCall
from dsc.components.parameters import Parameter
from dsc.skills import skill

if TYPE_CHECKING:
    from domains.clean_up_table.results import Result


class Tracks(Base):
    """A base on tracks: slow, turns on the spot first, and waits at a blocked path before it reports it."""

    declares: ClassVar[Mapping[str, Parameter]] = {
        **Base.declares,
        "speed": Parameter("number", default=0.2, least=0.05, most=0.4),
        "turning": seconds(3.0),
        "patience": seconds(8.0),
    }

    @drives
    async def drive(self, call: SkillCall, to: str) -> Outcome:
        """Turn, drive to a place, and try a second time if the path is blocked."""
        metres = distance(self.world.place_before(call.action_id), to) if to in PLACES else 0.0
        await call.clock.sleep(self.parameters["turning"] + metres / self.parameters["speed"])
        result = self.world.drive(call.action_id, to)
        if result.outcome == "no_path":
            await call.clock.sleep(self.parameters["patience"])
            result = self.world.drive(again(call.action_id), to)
        return outcome_of(result)


class SuctionArm(Arm):
    """A suction arm: it pumps before a grasp, and tries a failed grasp a second time."""

    declares: ClassVar[Mapping[str, Parameter]] = {
        **Arm.declares,
        "vacuum": Parameter("number", least=20.0, most=80.0, changed_by="profile"),  # kPa below the air pressure
        "lifts": Parameter("number", default=1.0, least=0.1, most=2.0, changed_by="profile"),  # kilograms
    }
    relations = ("(<= ?lifts (* 0.025 ?vacuum))",)

    @picks_up
    async def pick_up(self, call: SkillCall, item: str, surface: str) -> Outcome:
        """Pick an item, with everything in it, up from a surface."""
        return await self._held(call, lambda action_id: self.world.pick_up(action_id, item, surface))

    @takes_out
    async def take_out(self, call: SkillCall, item: str, carrier: str, surface: str) -> Outcome:
        """Take an item out of its carrier on a surface; `gone` names the carrier."""
        return await self._held(call, lambda action_id: self.world.take_out(action_id, item, carrier, surface))

    @skill(outcomes={"vented": {}}, after_crash="repeat")
    async def vent(self, call: SkillCall) -> Outcome:
        """Let air into the suction cup, which empties the pump; nothing is held then."""
        await call.clock.sleep(0.5)
        return Outcome("vented")

    async def _held(self, call: SkillCall, grasp: Callable[[str], Result]) -> Outcome:
        pumping = self.parameters["vacuum"] / 20.0
        await call.clock.sleep(pumping + self.parameters["grasping"])
        result = grasp(call.action_id)
        if result.outcome == "grasp_failed":
            await call.clock.sleep(pumping)
            result = grasp(again(call.action_id))
        return outcome_of(result)


class PatientCamera(Camera):
    """A camera that looks a second time before it reports an empty surface."""

    @recognises
    async def recognise(self, call: SkillCall, surface: str) -> Outcome:
        """Recognise the items on a surface; `count` is their number, without items inside others."""
        await call.clock.sleep(self.parameters["recognising"])
        result = self.world.recognise(call.action_id, surface)
        if result.outcome == "nothing_found":
            await call.clock.sleep(self.parameters["recognising"])
            result = self.world.recognise(again(call.action_id), surface)
        return outcome_of(result)
