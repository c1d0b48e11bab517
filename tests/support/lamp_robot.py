"""A robot with one lamp, for programs around it."""

from __future__ import annotations

from typing import Any

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from knowledge_base import Delta, fact
from planning import PlanningDomain, Robot


class Lit(Outcome): ...


class Lamp(Component):
    name = "lamp"

    @skill(after_crash="repeat")
    async def turn_on(self, call: SkillCall) -> Lit:
        await call.clock.sleep(0.01)
        return Lit(observed=Delta(added=(fact("lit"),)))


def robot(**how: Any) -> Robot:
    """Return the robot of a lamp; the arguments are those of `Robot`."""
    domain = PlanningDomain.parse("(define (domain lamps) (:predicates (lit)) (:action turn-on :effect (lit)))")
    lamp = Lamp()
    plots = [primitive_plot(lamp.skills()["turn_on"], done="lit", implements="turn-on")]
    return Robot(domain, plots, [lamp], **how)
