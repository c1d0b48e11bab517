"""Faults of the clean-up-table world: seeded, bounded, and recorded.

The seed and the action id determine whether a fault happens in a call. The possible faults of the call also determine
its kind. Transient faults hit one subject at most `IN_A_ROW` consecutive times. One more consecutive failure therefore
proves a permanent fault.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dsc.chance import choose, uniform
from knowledge_base.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from domains.clean_up_table.items import Inventory, Item

NOTHING_FOUND = "nothing_found"
GRASP_FAILED = "grasp_failed"
NO_INVERSE_KINEMATICS = "no_inverse_kinematics"
NO_PATH = "no_path"
ITEM_SLIPPED = "item_slipped"
STACK_FELL = "stack_fell"
ITEM_MOVED = "item_moved"
ITEM_ADDED = "item_added"
KINDS = (
    NOTHING_FOUND,
    GRASP_FAILED,
    NO_INVERSE_KINEMATICS,
    NO_PATH,
    ITEM_SLIPPED,
    STACK_FELL,
    ITEM_MOVED,
    ITEM_ADDED,
)

IN_A_ROW = 3
"""The maximum number of consecutive transient faults of one subject."""
PERMANENT_SHARE = 0.12
"""The share of permanent faults among faults that may be permanent."""
PER_RUN = {ITEM_MOVED: 3, ITEM_ADDED: 2}
"""The maximum number of interferences by other people in a run, by kind."""


@dataclass(frozen=True, slots=True)
class FiredFault:
    """A fault that has happened in a run.

    Attributes:
        kind: one of `KINDS`.
        permanent: whether the fault is permanent.
        action_id: the call in which the fault happened.
        items: the items that the fault affects; for a permanent `no_path`, the items that can no longer be thrown away.
    """

    kind: str
    permanent: bool
    action_id: str
    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Draw:
    """A fault that will happen in a call."""

    kind: str
    permanent: bool


@dataclass
class WorldFaults:
    """Random draws of faults, and the record of all faults.

    Attributes:
        seed: the seed, which determines each draw together with the action id.
        chance: the chance of a fault in a call, in [0, 1].
        fired: the faults that happened, in order.
        ungraspable: the kind of fault of each item that can never be grasped.
        unrecognisable: the items that the camera no longer finds.
        unreachable: the destinations that no longer have a path.
        in_a_row: the number of consecutive failures of each effort on a subject, e.g. `grasp cup1`.
    """

    seed: int = 0
    chance: float = 0.0
    fired: list[FiredFault] = field(default_factory=list)
    ungraspable: dict[str, str] = field(default_factory=dict)
    unrecognisable: list[str] = field(default_factory=list)
    unreachable: list[str] = field(default_factory=list)
    in_a_row: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0.0 <= self.chance <= 1.0:
            raise InputError(f"the chance of a fault is between 0 and 1, not {self.chance}", found=str(self.chance))

    def draw(self, action_id: str, possible: Mapping[str, bool]) -> Draw | None:
        """Return the fault that happens in this call, or `None`.

        Args:
            action_id: the id of the call.
            possible: the kinds of faults that can happen in the call; true for a kind that may be permanent.
        """
        if not possible or uniform(self.seed, action_id, "fault") >= self.chance:
            return None
        kind = choose(self.seed, action_id, "kind", list(possible))
        lasting = uniform(self.seed, action_id, "permanent") < PERMANENT_SHARE
        return Draw(kind, permanent=possible[kind] and lasting)

    def fire(self, draw: Draw, action_id: str, *items: str) -> None:
        """Record that a drawn fault happened."""
        self.fired.append(FiredFault(draw.kind, draw.permanent, action_id, items))

    def left_for(self, kind: str) -> bool:
        """Return whether an interference of this kind may happen again in this run."""
        return sum(fault.kind == kind for fault in self.fired) < PER_RUN[kind]

    def may_fail(self, effort: str, subject: str) -> bool:
        """Return whether another transient fault may hit this effort on this subject (e.g. `grasp` on `cup1`)."""
        return self.in_a_row.get(f"{effort} {subject}", 0) < IN_A_ROW

    def failed(self, effort: str, subject: str) -> int:
        """Count a failure, and return the number of consecutive failures of the effort on the subject."""
        key = f"{effort} {subject}"
        self.in_a_row[key] = self.in_a_row.get(key, 0) + 1
        return self.in_a_row[key]

    def passed(self, effort: str, subject: str) -> None:
        """Record a success, which resets the number of consecutive failures."""
        self.in_a_row.pop(f"{effort} {subject}", None)


_REASONS = {GRASP_FAILED: "every grasp of it fails", NO_INVERSE_KINEMATICS: "the arm cannot reach it"}


@dataclass(frozen=True, slots=True)
class Left:
    """An item that was on the table and is not in its destination.

    Attributes:
        item: the name of the item.
        where: the surface on which the item lies, `hand`, or `in CARRIER`.
        reason: the permanent fault that keeps the item from its destination; `None` without a permanent fault.
    """

    item: str
    where: str
    reason: str | None


def blame(item: Item, items: Inventory, faults: WorldFaults) -> str | None:
    """Return, as text, the permanent fault that keeps an item from its destination; `None` without one."""
    if item.disposed:
        return None
    if item.name in faults.ungraspable:
        return _REASONS[faults.ungraspable[item.name]]
    if item.name in faults.unrecognisable:
        return "it cannot be recognised"
    if item.destination in faults.unreachable:
        return f"no path leads to the {item.destination}"
    if items.hidden(item) and item.behind and blame(items[item.behind], items, faults):
        return f"it is hidden behind {item.behind}"
    return _stuck(item, items, faults)


def _stuck(item: Item, items: Inventory, faults: WorldFaults) -> str | None:
    """Return why an item cannot leave its carrier; the arm unloads only carriers that are on a surface."""
    carrier = items.get(item.where)
    outer = items.get(carrier.where) if carrier else None
    if carrier and outer and blame(carrier, items, faults) and blame(outer, items, faults):
        return f"it is in {carrier.name}, which is stuck in {outer.name}"
    return None
