"""The base of the robot: it enters and leaves the lift."""

from __future__ import annotations

from domains.elevator.lift import FLOORS
from domains.elevator.ride import LIFT, Ride
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.facts import Delta, fact


class Inside(Outcome):
    """The robot is in the lift."""


class Outside(Outcome):
    """The robot is on a floor, whose sign it reads."""


class NotMoved(Outcome):
    """The robot stays where it is."""

    reason: str


class Base(Component):
    """The base, with its part of the domain."""

    name = "base"
    domain = """
    (define (domain base)
      (:types floor agent)
      (:constants robot - agent)
      (:predicates (inside) (arrived ?f - floor) (door-open) (at-floor ?who - agent ?f - floor))
      (:action enter-elevator
        :parameters ()
        :precondition (and (door-open) (not (inside)))
        :effect (inside))
      (:action exit-elevator
        :parameters (?floor - floor)
        :precondition (and (inside) (door-open) (at-floor robot ?floor))
        :effect (and (arrived ?floor) (not (inside)))))"""

    def __init__(self, ride: Ride) -> None:
        super().__init__()
        self._ride = ride

    @skill(after_crash="same_id")
    async def enter(self, call: SkillCall) -> Inside | NotMoved:
        """Let the persons leave, then enter."""
        await call.clock.sleep(3.0)
        refusal = self._refusal(call, "full")
        if (reason := self._ride.move(call.action_id, None if refusal else LIFT, refusal)) is not None:
            return NotMoved(reason=reason)
        floors = tuple(fact("arrived", floor) for floor in FLOORS)
        return Inside(observed=Delta(added=(fact("inside"),), removed=floors))

    @skill(after_crash="same_id")
    async def leave(self, call: SkillCall) -> Outside | NotMoved:
        """Leave the lift, and read the sign of the floor."""
        await call.clock.sleep(2.0)
        stop = self._ride.visible_stop(call.clock.now())
        refusal = self._refusal(call, "blocked")
        floor = None if stop is None or refusal else stop.floor
        if (reason := self._ride.move(call.action_id, floor, refusal)) is not None:
            return NotMoved(reason=reason)
        return Outside(observed=Delta(added=(fact("arrived", self._ride.place),), removed=(fact("inside"),)))

    def _refusal(self, call: SkillCall, kind: str) -> str | None:
        if self._ride.visible_stop(call.clock.now()) is None:
            return "the door is closed"
        reasons = {"full": "the lift is full", "blocked": "a person stands in the way"}
        return reasons[kind] if self._ride.mishap(call.action_id, kind) else None
