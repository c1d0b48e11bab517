"""Foresight: simulation of a plan on a copy of the world that the robot believes in, without faults (S1.10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from domains.clean_up_table.items import CRISP_CAN, HAND, KINDS, OPERATOR, ROOMS, SURFACES, Item, new_item
from domains.clean_up_table.table_world import TableWorld
from planning.analysis.validation import Validation

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from domains.clean_up_table.observations import Result
    from knowledge_base.language.evaluation.world_protocol import World as Belief
    from planning.model.plan import Plan, PlanStep

_VERBS: dict[str, Callable[[TableWorld, str, tuple[str, ...]], Result]] = {
    "drive": lambda world, name, args: world.drive(name, args[1]),
    "pick-up": lambda world, name, args: world.pick_up(name, args[0], args[1]),
    "put-down": lambda world, name, args: world.put_down(name, args[0], args[1]),
    "stack": lambda world, name, args: world.stack(name, args[0], args[1], args[4]),
    "take-out": lambda world, name, args: world.take_out(name, args[0], args[1], args[4]),
    "check-room": lambda world, name, args: world.look_into(name, args[0], args[3]),
    "throw-away": lambda world, name, args: world.throw_away(name, args[0], args[1]),
}
"""The verb of the world for each planning action; the arguments are in the order of `domain.pddl`."""

_HOPED_FOR = frozenset({"arrived", "picked_up", "put_down", "stacked", "taken_out", "looked", "thrown_away"})


class Physics:
    """A `Foresight` that applies the true rules of carriers, room and obstacles."""

    def foresee(self, plan: Plan, world: Belief) -> Validation:
        """Simulate the plan without faults, and return the first step that fails; `world` stays unchanged."""
        ahead = believed(world)
        for number, step in enumerate(plan.steps):
            result = self._tried(ahead, f"step {number}", step)
            if result.outcome not in _HOPED_FOR:
                why = result.attributes.get("reason", result.outcome)
                return Validation(valid=False, failing_step=number, why=f"{step} ends in {result.outcome}: {why}")
        return Validation(valid=True)

    @staticmethod
    def _tried(ahead: TableWorld, name: str, step: PlanStep) -> Result:
        return _VERBS[step.action](ahead, name, step.args)


def believed(belief: Belief) -> TableWorld:
    """Return the world in which all beliefs are true; items without a believed place are omitted."""
    at = [str(place) for (place,) in belief.match("robot-at", (None,))]
    return TableWorld(_items(belief), robot_at=at[0] if at else OPERATOR)


def _items(belief: Belief) -> Iterator[Item]:
    for kind in KINDS:
        for name in belief.objects(kind):
            where = _where(name, belief)
            if where is not None:
                yield _item(name, kind, where, belief)


def _item(name: str, kind: str, where: str, belief: Belief) -> Item:
    """Return an item with the smallest capacity that agrees with the believed contents and free room."""
    inside = len(list(belief.match("inside", (None, name))))
    room = max((ROOMS.index(str(room)) for _, room in belief.match("free-room", (name, None))), default=0)
    item = new_item(kind, name, size="large" if kind == CRISP_CAN and inside + room > 1 else "small")
    item.where = where
    item.closed = max(0, item.capacity - inside - room)
    item.seen = True
    return item


def _where(name: str, belief: Belief) -> str | None:
    if belief.holds("holding", (name,)):
        return HAND
    for predicate in ("inside", "lies-at"):
        for _, where in belief.match(predicate, (name, None)):
            if predicate == "inside" or where in SURFACES:
                return str(where)
    return None
