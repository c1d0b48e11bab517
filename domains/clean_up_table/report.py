"""The honest report: judged by the world's truth, explained by what the robot knows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from domains.clean_up_table.table_world import TableWorld
from domains.tally import Tally
from dsc.sequencer.sequencer import RunEnd
from knowledge_base.store import KnowledgeBase

FAILURES = frozenset({
    "nothing_found", "grasp_failed", "no_ik", "no_path", "slipped", "stack_fell", "gone", "not_possible",
    "timed_out", "skill_error",
})  # fmt: skip
"""Outcomes of skills that were not what a plan hopes for."""
STOPPED = "stopped"
"""What the plot emits when it has ended because the operator said stop."""


@dataclass(frozen=True, slots=True)
class LeftItem:
    """An item that was not cleared away: where it really is, and why as far as the robot knows."""

    item: str
    where: str
    reason: str


@dataclass(frozen=True, slots=True)
class ReportedFault:
    """A fault that the simulation let happen: its kind, whether it passes, and the items it hit."""

    kind: str
    permanent: bool
    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """What a run came to.

    Attributes:
        goal_reached: every item that ever stood on the table, seen or not, is where it belongs, and the run
            came to its end without a problem.
        items: how many stood on the table.
        left: those that are not where they belong.
        trips: times something was thrown away.
        plans, replans: plans found, and plans given up for a new one.
        skill_failures: outcomes of skills that were not hoped for, and how often.
        recoveries: rules that answered, and how often.
        candidates_chosen: plots that dynamic states chose, and how often.
        excluded: steps that plans did without for a while since they had failed, and how often.
        faults: what the simulation did to the robot, in order.
        touched: the items that a permanent fault keeps from where they belong.
        simulated_s, wall_s: seconds of run time and of real time.
        problem: why the run ended early, if it did.
    """

    goal_reached: bool
    items: int
    left: tuple[LeftItem, ...]
    trips: int
    plans: int
    replans: int
    skill_failures: Mapping[str, int]
    recoveries: Mapping[str, int]
    candidates_chosen: Mapping[str, int]
    excluded: Mapping[str, int]
    faults: tuple[ReportedFault, ...]
    touched: tuple[str, ...]
    simulated_s: float
    wall_s: float
    problem: str | None = field(default=None)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)

    def lines(self) -> list[str]:
        """The report for people."""
        done = self.items - len(self.left)
        what = "The table is clear" if self.goal_reached else "Not everything could be cleared"
        lines = [
            f"{what}: {done} of {self.items} items away in {self.trips} trips, {self.simulated_s:.0f} s simulated.",
            *(f"  left: {one.item} ({one.where}): {one.reason}" for one in self.left),
            f"  plans {self.plans}, replans {self.replans}",
        ]
        for title, counts in (
            ("skill failures", self.skill_failures),
            ("recovered by rule", self.recoveries),
            ("candidates chosen", self.candidates_chosen),
            ("done without for a while", self.excluded),
        ):
            if counts:
                lines.append(f"  {title}: " + ", ".join(f"{name} {n}" for name, n in counts.items()))
        return lines


def summarise(world: TableWorld, knowledge: KnowledgeBase, tally: Tally, end: RunEnd, wall_s: float) -> Report:
    """The report of a run that has ended."""
    left = tuple(LeftItem(one.item, one.where, reason_for(one.item, knowledge, end)) for one in world.left())
    return Report(
        goal_reached=not left and end.problem is None,
        items=sum(1 for item in world.items if item.on_table),
        left=left,
        trips=world.trips,
        plans=tally.plans,
        replans=tally.replans,
        skill_failures={name: n for name, n in sorted(tally.outcomes.items()) if name in FAILURES},
        recoveries=dict(sorted(tally.recoveries.items())),
        candidates_chosen=dict(sorted(tally.candidates.items())),
        excluded=dict(sorted(tally.excluded.items())),
        faults=tuple(ReportedFault(one.kind, one.permanent, one.items) for one in world.fired),
        touched=tuple(sorted(world.touched())),
        simulated_s=round(tally.seconds, 3),
        wall_s=round(wall_s, 3),
        problem=end.problem,
    )


def reason_for(item: str, knowledge: KnowledgeBase, end: RunEnd) -> str:
    """Why an item is left, as far as the robot knows."""
    about = {"item": item}
    if knowledge.type_of(item) is None:
        return "it was never seen"
    if not knowledge.ask("(graspable ?item)", about):
        return f"it cannot be grasped, {knowledge.value('failures', (item,)):g} tries in a row failed"
    blocked = knowledge.query("(and (goes-to ?item ?place) (not (passable ?place)))", about)
    if blocked:
        return f"no path to the {blocked[0]['place']}"
    if knowledge.ask("(missing ?item)", about):
        return "it was seen, and not found again"
    carriers = knowledge.query("(inside ?item ?carrier)", about)
    if carriers:
        carrier = str(carriers[0]["carrier"])
        return f"it is in {carrier}: {reason_for(carrier, knowledge, end)}"
    return _why_it_ended(end)


def _why_it_ended(end: RunEnd) -> str:
    if any(event.name == STOPPED for event in end.emitted):
        return "the operator stopped the run"
    return end.problem or "the run ended before it was cleared away"
