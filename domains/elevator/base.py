"""The base of the robot: it enters and leaves the lift."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

from domains.elevator.lift import LIFT, NAMES
from domains.elevator.perception import FLOOR_KNOWLEDGE
from domains.elevator.ride import Ride
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.skills import skill
from dsc.trees import Action, BoundTree, Condition, bind_tree, load_trees, tree_skill
from knowledge_base.facts import Delta, fact

TREES = load_trees(Path(str(files("domains.elevator"))) / "trees" / "enter.xml")
Position = Annotated[list[float], "geometry"]
"""Coordinates x and y in metres, from the knowledge base."""


class Inside(Outcome):
    """The robot is in the lift."""


class NotInside(Outcome):
    """The door has closed, or the lift is full."""


class Outside(Outcome):
    """The robot is on a floor, whose sign it reads."""


class NotMoved(Outcome):
    """The robot stays in the lift."""

    reason: str


class Base(Component):
    """The base, with its part of the domain."""

    name = "base"
    domain = """
    (define (domain base)
      (:types floor agent)
      (:constants robot - agent)
      (:predicates (inside) (arrived ?f - floor) (door-open) (floor-known) (at-floor ?who - agent ?f - floor))
      (:functions (position ?f - floor) - geometry) ; the place next to the lift
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

    @tree_skill(success=Inside, failure=NotInside, after_crash="same_id")
    def enter(self, call: SkillCall) -> BoundTree:
        """Let the persons leave, then enter, while the door is open."""
        leaves = {
            "DoorOpen": Condition(lambda: self._ride.visible_stop(call.clock.now()) is not None),
            "LetPersonsLeave": Action(lambda: self._wait(call), ends={"done"}),
            "DriveIn": Action(lambda: self._drive_in(call), ends={"inside"}),
        }
        return bind_tree(TREES, leaves)

    @skill(after_crash="same_id")
    async def leave(self, call: SkillCall, place: Position) -> Outside | NotMoved:
        """Leave the lift, drive to a place, and read the sign of the floor."""
        await call.clock.sleep(1.0 + abs(place[0]))
        stop = self._ride.visible_stop(call.clock.now())
        refusal = None
        if stop is None:
            refusal = "the door is closed"
        elif self._ride.mishap(call.action_id, "blocked"):
            refusal = "a person stands in the way"
        to = None if stop is None or refusal else stop.floor
        if (reason := self._ride.move(call.action_id, to, refusal)) is not None:
            return NotMoved(reason=reason)
        outdated = (fact("inside"), *FLOOR_KNOWLEDGE)
        return Outside(observed=Delta(added=(fact("arrived", self._ride.place),), removed=outdated))

    async def _wait(self, call: SkillCall) -> Outcome:
        await call.clock.sleep(2.0)
        return Outcome("done")

    async def _drive_in(self, call: SkillCall) -> Outcome:
        await call.clock.sleep(1.0)
        full = "the lift is full" if self._ride.mishap(call.action_id, "full") else None
        if self._ride.move(call.action_id, None if full else LIFT, full) is not None:
            return Outcome("full")
        floors = tuple(fact("arrived", floor) for floor in NAMES)
        return Outcome("inside", observed=Delta(added=(fact("inside"),), removed=floors))
