"""Mission control: a behaviour tree that sets a goal for each phase (S4.8, S4.11)."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from dsc.calls import SkillCall
from dsc.components.clients import QueryClient
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.trees import Action, BoundTree, bind_tree, load_trees, tree_skill

TREES = load_trees(Path(str(files("domains.elevator"))) / "trees" / "take_elevator.xml")


class AtDestination(Outcome):
    """The robot is on its floor."""


class NotAtDestination(Outcome):
    """The robot has tried each phase too often."""


class Mission(Component):
    """The first tier of the robot.

    Attributes:
        reasons: the reasons of the goals that were not reached.
    """

    name = "mission"
    goals = QueryClient({"goal": "text"}, answer={"reached": "boolean", "reason": "text"})

    def __init__(self) -> None:
        super().__init__()
        self.reasons: list[str] = []

    @tree_skill(success=AtDestination, failure=NotAtDestination, after_crash="repeat")
    def take_elevator(self, call: SkillCall, floor: str) -> BoundTree:  # noqa: ARG002
        """Enter the lift, and leave it on a floor."""
        leaves = {
            "Enter": Action(lambda floor: self._pursue(f"(or (inside) (arrived {floor}))"), ends={"reached"}),
            "Ride": Action(lambda floor: self._pursue(f"(arrived {floor})"), ends={"reached"}),
        }
        return bind_tree(TREES, leaves, entries={"floor": floor})

    async def _pursue(self, goal: str) -> Outcome:
        end = await self.goals.ask(goal=goal, within=3600)
        if end["reached"]:
            return Outcome("reached")
        self.reasons.append(end["reason"])
        return Outcome("not_reached")
