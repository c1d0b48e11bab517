"""Faults of the clean-up-table world: seeded, bounded, recorded (S0.15).

Seed and action id decide whether a fault happens in a call; the possible faults of the call also decide which one. A
transient fault hits the same subject at most `IN_A_ROW` times in a row, so that one more failure proves a permanent
fault.
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
"""Maximum number of consecutive transient faults of the same subject."""
PERMANENT_SHARE = 0.12
"""The share of permanent faults where a permanent form exists."""
PER_RUN = {ITEM_MOVED: 3, ITEM_ADDED: 2}
"""Maximum number of interferences by other people in a run."""


@dataclass(frozen=True, slots=True)
class FiredFault:
    """A fault that happened.

    Attributes:
        kind: one of `KINDS`.
        permanent: whether it is permanent.
        action_id: the call with the fault.
        items: the items it hit; for a permanent `no_path` those it keeps from being thrown away.
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
    """Draws faults and records them.

    Attributes:
        fired: every fault that happened, in order.
        ungraspable: items that can never be grasped, with the kind of fault.
        unrecognisable: items that the camera no longer finds.
        unreachable: destinations without a path from now on.
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
        """Return the fault of this call, or `None`.

        Args:
            action_id: the call.
            possible: the kinds that can happen in it now; true for a kind that may be permanent.
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
        """Return whether this interference may happen again in this run."""
        return sum(fault.kind == kind for fault in self.fired) < PER_RUN[kind]

    def may_fail(self, effort: str, subject: str) -> bool:
        """Return whether another transient fault may hit this effort (e.g. `grasp` of `cup1`)."""
        return self._in_a_row.get(f"{effort} {subject}", 0) < IN_A_ROW

    def failed(self, effort: str, subject: str) -> int:
        """Count a failure; return the number of consecutive failures."""
        key = f"{effort} {subject}"
        self._in_a_row[key] = self._in_a_row.get(key, 0) + 1
        return self._in_a_row[key]

    def passed(self, effort: str, subject: str) -> None:
        """Count a success, which ends a sequence of failures."""
        self._in_a_row.pop(f"{effort} {subject}", None)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON data."""
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
        """Return the faults of a form; the inverse of `to_json`."""
        faults = cls(data["seed"], data["chance"])
        faults.fired = [FiredFault(**{**fault, "items": tuple(fault["items"])}) for fault in data["fired"]]
        faults.ungraspable = dict(data["ungraspable"])
        faults.unrecognisable = list(data["unrecognisable"])
        faults.unreachable = list(data["unreachable"])
        faults._in_a_row = dict(data["in_a_row"])
        return faults
