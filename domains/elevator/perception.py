"""Perception of the robot: the door of the lift, the persons in it, and the head that faces them."""

from __future__ import annotations

from domains.elevator.lift import NAMES, PERSONS
from domains.elevator.ride import Ride
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.facts import Delta, fact

FLOOR_KNOWLEDGE = (fact("floor-known"), *(fact("at-floor", "robot", floor) for floor in NAMES))
"""The facts that an answer about the floor may have made true."""


class Over(Outcome):
    """The perception has ended."""


class Door(Component):
    """The sensor of the door, with its part of the domain (S4.6)."""

    name = "door"
    domain = """
    (define (domain door)
      (:types floor)
      (:predicates (door-open) (floor-known))
      (:action check-door ; wait until the door opens at another floor
        :parameters ()
        :effect (and (door-open) (not (floor-known)))))"""

    def __init__(self, ride: Ride) -> None:
        super().__init__()
        self._ride = ride

    @skill(after_crash="repeat", unlimited=True)
    async def perceive(self, call: SkillCall) -> Over:
        """Report each change of the door; a closed door outdates what the robot knows about its floor."""
        closed = Delta(removed=(fact("door-open"), *FLOOR_KNOWLEDGE))
        while True:
            now = call.clock.now()
            is_open = self._ride.visible_stop(now) is not None
            call.observe(Delta(added=(fact("door-open"),)) if is_open else closed)
            await call.clock.sleep(self._ride.lift.next_change(now) - now)


class People(Component):
    """The perception of persons, with its part of the domain."""

    name = "people"
    domain = """
    (define (domain people)
      (:types person - agent agent)
      (:constants robot - agent)
      (:predicates (in-lift ?p - person) (looks-at ?who ?what - object))
      (:action face-person
        :parameters (?person - person)
        :precondition (in-lift ?person)
        :effect (looks-at robot ?person)))"""

    def __init__(self, ride: Ride) -> None:
        super().__init__()
        self._ride = ride

    @skill(after_crash="repeat", unlimited=True)
    async def perceive(self, call: SkillCall, every: float = 0.1) -> Over:
        """Report the persons in the lift when they change; `every` is the period of a look in seconds."""
        before: tuple[str, ...] | None = None
        while True:
            seen = self._ride.persons(call.clock.now())
            if seen != before:
                gone = [name for name in PERSONS if name not in seen]
                arcs = [fact(arc, "robot", name) for name in gone for arc in ("want-see", "looks-at")]
                absent = (*(fact("in-lift", name) for name in gone), *arcs)
                call.observe(Delta(added=tuple(fact("in-lift", name) for name in seen), removed=absent))
                before = seen
            await call.clock.sleep(every)


class Head:
    """The driver of the head, for the component `attention`."""

    def __init__(self, ride: Ride) -> None:
        self._ride = ride

    async def turn_to(self, call: SkillCall, what: str) -> str | None:
        """Turn to a person in the lift."""
        await call.clock.sleep(1.0)
        if what not in self._ride.persons(call.clock.now()):
            return f"{what} is not in the lift"
        return "the face is hidden" if self._ride.mishap(call.action_id, "hidden") else None
