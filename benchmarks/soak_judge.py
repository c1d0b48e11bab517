"""What must hold of every run of the soak, each under its name, and the truth that it is judged by."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from soak_told import Told

from domains.clean_up_table.items import Item
from domains.clean_up_table.places import SURFACES
from domains.clean_up_table.report import Report
from domains.clean_up_table.table_world import TableWorld
from domains.clean_up_table.world_faults import ITEM_MOVED
from dsc.dynamic.library import Library
from dsc.sequencer.sequencer import Sequencer
from dsc.testing.invariants import (
    Invariant,
    KeptRun,
    claims_nothing_false,
    comes_to_an_end,
    executed_once,
    knows,
    one_history,
    replays,
)
from knowledge_base.facts import Delta, Fact, fact

NO_REPORT, TWICE, NOT_SO, FALSE_CLAIM = "no report", "executed twice", "knowledge is not so", "false claim"
HANGS, HISTORY, AFTER_STOP = "hangs", "another history", "acts after a stop"
PROMISES = (TWICE, NOT_SO, FALSE_CLAIM, NO_REPORT, HANGS, HISTORY, AFTER_STOP)
"""Names of all that must hold."""
LONGEST = 6 * 3600.0
"""Seconds of run time that a table may take."""
PREDICATES = ("robot-at", "hand-free", "holding", "inside", "lies-at", "disposed", "missing")
STOPPED = ("stopped",)
"""The configuration in which the operator's stop is obeyed."""


def invariants(world: TableWorld, library: Library | None, *, replayed: bool) -> Iterator[tuple[str, Invariant]]:
    """What a run must be like that has led to that world."""
    cleared = all(item.disposed for item in world.items if item.seen)
    yield NO_REPORT, comes_to_an_end(LONGEST)
    yield TWICE, executed_once(list(world.done))  # the world refuses to do an id twice: what is found are foreign ones
    yield HISTORY, one_history
    if replayed:
        yield HISTORY, replays(library)
    yield NOT_SO, knows_what_it_was_told(world)
    yield FALSE_CLAIM, claims_nothing_false(says_all_is_clear, reached=cleared)
    yield AFTER_STOP, stands_still


def knows_what_it_was_told(world: TableWorld) -> Invariant:
    """How the robot is itself, and of each item where it was told that it is: that, and nothing else."""

    def invariant(run: KeptRun) -> Iterable[str]:
        told = Told(run, world)
        yield from told.untrue()
        yield from knows({*itself(world), *told.expected()}, PREDICATES)(run)

    return invariant


def itself(world: TableWorld) -> Iterator[Fact]:
    """What the robot knows of itself."""
    yield fact("robot-at", world.robot_at)
    if world.items.held is None:
        yield fact("hand-free")


def says_all_is_clear(run: KeptRun) -> bool:
    """Whether the robot has told the operator so."""
    return any(one.data["chosen"] == "announce_success" for one in run.records if one.type == "decision")


def stands_still(run: KeptRun) -> Iterable[str]:
    """While the operator's stop is obeyed, nothing that was started goes on and nothing is started."""
    going_on: dict[str, str] = {}
    for step in run.steps:
        for record in step.records:
            if record.type == "action" and record.data["action"] == "start":
                going_on[record.data["id"]] = record.data["skill"]
            if record.type == "action" and record.data["action"] == "cancel":
                going_on.pop(record.data["id"], None)
        if step.message.get("final"):
            going_on.pop(step.message["action"], None)
        if step.configuration == STOPPED:
            yield from (f"{skill} goes on at second {step.time:g}" for skill in going_on.values())


def ended_stopped(run: KeptRun) -> bool:
    """Whether nobody has let it go on after a stop."""
    return len(run.steps) > 1 and run.steps[-1 if run.ended is None else -2].configuration == STOPPED


def wrong_report(report: Report, world: TableWorld, *, stopped: bool, plain: bool) -> Iterator[str]:
    """What a report says that is not so.

    Args:
        report: of the run.
        world: what has become of it.
        stopped: whether an operator has ended the run.
        plain: whether nothing else but a permanent fault has kept the robot from anything.
    """
    if report.goal_reached and not world.goal_reached:
        yield "the report says that the goal is reached"
    left = {one.item for one in report.left}
    if left != {one.item for one in world.left()}:
        yield f"the report says that {sorted(left)} are left"
    if stopped and any("the run ended" in one.reason for one in report.left):
        yield "the report does not say that the operator stopped the run"
    if plain and not stopped:
        if report.problem is not None:
            yield f"the run ended early: {report.problem}"
        if left != world.touched():
            yield f"left are {sorted(left)}, and permanent faults have touched {sorted(world.touched())}"


def said_by_others(world: TableWorld, sequencer: Sequencer) -> list[Delta]:
    """What somebody who saw it could say: where an item is, rather of one that somebody has moved.

    Not of what the robot handles at the moment: who of the two sees it last would be anybody's guess.
    """
    handled = {str(value) for start in sequencer.dispatcher.started() for value in start.arguments.values()}
    known = [item for item in world.items if sequencer.knowledge.type_of(item.name) is not None]
    items = [item for item in known if item.where in SURFACES and item.name not in handled]
    moved = {name for fault in world.fired if fault.kind == ITEM_MOVED for name in fault.items}
    return [_lies(item, known) for item in [item for item in items if item.name in moved] or items]


def _lies(item: Item, known: Iterable[Item]) -> Delta:
    elsewhere = [fact("lies-at", item.name, other) for other in SURFACES if other != item.where]
    inside = [fact("inside", item.name, other.name) for other in known if other is not item]
    there = fact("lies-at", item.name, item.where)
    return Delta(removed=(fact("missing", item.name), *elsewhere, *inside), added=(there,))
