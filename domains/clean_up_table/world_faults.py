"""What goes wrong in the clean-up-table world, and when: seeded, bounded, remembered (S0.15).

Whether a fault fires in a call is a function of (seed, action id); which one it is depends also on what can
happen in that call now. A passing fault passes: the same subject fails at most `IN_A_ROW` times in a row,
so that one more failure proves the fault permanent.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from dsc.chance import choose, uniform
from knowledge_base.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

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
"""How often in a row a passing fault can hit the same subject."""
PERMANENT_SHARE = 0.12
"""The share of permanent faults where a permanent form exists."""
PER_RUN = {ITEM_MOVED: 3, ITEM_ADDED: 2}
"""How often somebody else interferes in a run, at most."""


@dataclass(frozen=True, slots=True)
class FiredFault:
    """A fault that happened.

    Attributes:
        kind: one of `KINDS`.
        permanent: whether it will never pass.
        action_id: the call it happened in.
        items: the items it happened to; for a permanent `no_path` those it keeps from being thrown away.
    """

    kind: str
    permanent: bool
    action_id: str
    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Draw:
    """A fault that is about to happen in a call."""

    kind: str
    permanent: bool


class WorldFaults:
    """Decides on faults and remembers them.

    Attributes:
        fired: every fault that happened, in order.
        ungraspable: items that can never be grasped, with the kind of fault.
        unrecognisable: items that no perception finds any more.
        unreachable: destinations that no path leads to any more.
    """

    def __init__(self, seed: int = 0, chance: float = 0.0) -> None:
        if not 0.0 <= chance <= 1.0:
            raise InputError(f"the chance of a fault is between 0 and 1, not {chance}", found=str(chance))
        self.seed = seed
        self.chance = chance
        self.fired: list[FiredFault] = []
        self.ungraspable: dict[str, str] = {}
        self.unrecognisable: list[str] = []
        self.unreachable: list[str] = []
        self._in_a_row: dict[str, int] = {}

    def draw(self, action_id: str, possible: Mapping[str, bool]) -> Draw | None:
        """The fault that happens in this call, if one does.

        Args:
            action_id: the call.
            possible: the kinds that can happen in it now, each with whether it could be permanent.
        """
        if not possible or uniform(self.seed, action_id, "fault") >= self.chance:
            return None
        kind = choose(self.seed, action_id, "kind", list(possible))
        lasting = uniform(self.seed, action_id, "permanent") < PERMANENT_SHARE
        return Draw(kind, permanent=possible[kind] and lasting)

    def fire(self, draw: Draw, action_id: str, *items: str) -> None:
        """Remember that a drawn fault happened."""
        self.fired.append(FiredFault(draw.kind, draw.permanent, action_id, items))

    def left_for(self, kind: str) -> bool:
        """Whether somebody else may interfere in this way once more in this run."""
        return sum(fault.kind == kind for fault in self.fired) < PER_RUN[kind]

    def may_fail(self, effort: str, subject: str) -> bool:
        """Whether a passing fault may hit this effort (e.g. `grasp` of `cup1`) once more in a row."""
        return self._in_a_row.get(f"{effort} {subject}", 0) < IN_A_ROW

    def failed(self, effort: str, subject: str) -> int:
        """Count a failure; how many there have been in a row."""
        key = f"{effort} {subject}"
        self._in_a_row[key] = self._in_a_row.get(key, 0) + 1
        return self._in_a_row[key]

    def passed(self, effort: str, subject: str) -> None:
        """Count a success: the row of failures ends."""
        self._in_a_row.pop(f"{effort} {subject}", None)

    def to_json(self) -> dict[str, Any]:
        """As plain JSON data."""
        return {
            "seed": self.seed,
            "chance": self.chance,
            "fired": [{**asdict(fault), "items": list(fault.items)} for fault in self.fired],
            "ungraspable": dict(self.ungraspable),
            "unrecognisable": list(self.unrecognisable),
            "unreachable": list(self.unreachable),
            "in_a_row": dict(self._in_a_row),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> WorldFaults:
        """The inverse of `to_json`."""
        faults = cls(data["seed"], data["chance"])
        faults.fired = [FiredFault(**{**fault, "items": tuple(fault["items"])}) for fault in data["fired"]]
        faults.ungraspable = dict(data["ungraspable"])
        faults.unrecognisable = list(data["unrecognisable"])
        faults.unreachable = list(data["unreachable"])
        faults._in_a_row = dict(data["in_a_row"])
        return faults
