"""The report of a run: the true state of the world, with reasons from the robot's knowledge."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from domains.clean_up_table.table_world import TableWorld
from domains.progress import Tally
from dsc.sequencer.sequencer import RunEnd
from knowledge_base.store import KnowledgeBase

FAILURES = frozenset({
    "nothing_found", "grasp_failed", "no_ik", "no_path", "slipped", "stack_fell", "gone", "not_possible",
    "timed_out", "skill_error",
})  # fmt: skip
"""The outcomes of skills that count as failures of a plan step."""
STOPPED = "stopped"
"""The event that the plot emits if the operator stops the run."""


@dataclass(frozen=True, slots=True)
class LeftItem:
    """An item that was not cleared away, with its true place, and the reason from the robot's knowledge."""

    item: str
    where: str
    reason: str


@dataclass(frozen=True, slots=True)
class ReportedFault:
    """A fault of the simulation: its kind, whether it is permanent, and the items that it affects."""

    kind: str
    permanent: bool
    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """The result of a run.

    Attributes:
        goal_reached: whether every item that was ever on the table, seen or not, is in its destination, and the run
            ended without a problem.
        items: the number of items that were on the table.
        left: the items that are not in their destinations.
        trips: the number of throws.
        plans, replans: the number of plans found, and the number of plans that replaced another plan.
        skill_failures: the number of each failure outcome of skills.
        recoveries: the number of uses of each rule.
        candidates_chosen: the number of choices of each plot by dynamic states.
        excluded: the number of exclusions of each plan step after failures.
        faults: the faults of the simulation, in order.
        touched: the items that a permanent fault keeps from their destinations.
        simulated_s, wall_s: the duration of the run in run time and in real time, in seconds.
        problem: the reason why the run ended early; `None` otherwise.
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
        """Return the report as plain data."""
        return asdict(self)

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
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
            ("excluded for a while", self.excluded),
        ):
            if counts:
                lines.append(f"  {title}: " + ", ".join(f"{name} {n}" for name, n in counts.items()))
        return lines


def summarise(world: TableWorld, knowledge: KnowledgeBase, tally: Tally, end: RunEnd, wall_s: float) -> Report:
    """Return the report of a run that has ended, which took `wall_s` seconds of real time."""
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
    """Return the reason why an item is left, from the robot's knowledge."""
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
