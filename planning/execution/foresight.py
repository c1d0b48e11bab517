"""Looking ahead: a plan is tried out in a simulation before a robot carries it out (S1.10)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from knowledge_base.language.evaluation import World
    from planning.plan import Plan
    from planning.validation import Validation


class Foresight(Protocol):
    """A simulation that knows more than the planning domain does, e.g. the physics of a ready world."""

    def foresee(self, plan: Plan, world: World) -> Validation:
        """What will come of the plan when it is carried out from `world`, the world as the robot believes it to be.

        A plan that is not valid is rejected, and its failing step left out of the next one. Called in a thread of its
        own; must end by itself and change nothing.
        """
        ...
