"""The promises that each run of the soak must keep, by name, and the true state to compare the run with."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from soak_told import Told

from domains.clean_up_table.items import SURFACES, Item
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
from planning.robot.report import Report

NO_REPORT, TWICE, NOT_SO, FALSE_CLAIM = "no report", "executed twice", "knowledge is not so", "false claim"
HANGS, HISTORY, AFTER_STOP = "hangs", "another history", "acts after a stop"
PROMISES = (TWICE, NOT_SO, FALSE_CLAIM, NO_REPORT, HANGS, HISTORY, AFTER_STOP)
"""The names of all promises."""
LONGEST = 6 * 3600.0
"""Maximum seconds of run time for a table."""
PREDICATES = ("robot-at", "hand-free", "holding", "inside", "lies-at", "disposed", "missing")
STOPPED = ("stopped",)
"""The configuration after the operator's stop."""


def invariants(world: TableWorld, library: Library | None, *, replayed: bool) -> Iterator[tuple[str, Invariant]]:
    """Yield the invariants of a run that has led to that world, each with its promise."""
    cleared = all(item.disposed for item in world.items if item.seen)
    yield NO_REPORT, comes_to_an_end(LONGEST)
    yield TWICE, executed_once(list(world.done))  # the world ignores a repeated id, so this finds foreign ones
    yield HISTORY, one_history
    if replayed:
        yield HISTORY, replays(library)
    yield NOT_SO, knows_what_it_was_told(world)
    yield FALSE_CLAIM, claims_nothing_false(says_all_is_clear, reached=cleared)
    yield AFTER_STOP, stands_still


def knows_what_it_was_told(world: TableWorld) -> Invariant:
    """Return the invariant that the robot knows exactly its own state and the reported place of each item."""

    def invariant(run: KeptRun) -> Iterable[str]:
        told = Told(run, world)
        yield from told.untrue()
        yield from knows({*itself(world), *told.expected()}, PREDICATES)(run)

    return invariant


def itself(world: TableWorld) -> Iterator[Fact]:
    """Yield the facts that the robot must know about itself."""
    yield fact("robot-at", world.robot_at)
    if world.items.held is None:
        yield fact("hand-free")


def says_all_is_clear(run: KeptRun) -> bool:
    """Return whether the robot has announced success to the operator."""
    return any(one.data["chosen"] == "announce_success" for one in run.records if one.type == "decision")


def stands_still(run: KeptRun) -> Iterable[str]:
    """Yield skills that run on, or start, after the operator's stop."""
    improving: dict[str, str] = {}
    for step in run.steps:
        for record in step.records:
            if record.type == "action" and record.data["action"] == "start":
                improving[record.data["id"]] = record.data["skill"]
            if record.type == "action" and record.data["action"] == "cancel":
                improving.pop(record.data["id"], None)
        if step.message.get("final"):
            improving.pop(step.message["action"], None)
        if step.configuration == STOPPED:
            yield from (f"{skill} still runs at second {step.time:g}" for skill in improving.values())


def ended_stopped(run: KeptRun) -> bool:
    """Return whether the run ended in the operator's stop."""
    return len(run.steps) > 1 and run.steps[-1 if run.ended is None else -2].configuration == STOPPED


def wrong_report(report: Report, world: TableWorld, *, stopped: bool, plain: bool) -> Iterator[str]:
    """Yield the false statements of a report.

    Args:
        report: the report of the run.
        world: the world after the run.
        stopped: whether an operator has ended the run.
        plain: whether only permanent faults may have kept the robot from its goal.
    """
    if report.programming_error is not None:
        yield f"programming error in {report.programming_error}"
    if report.goal_reached and not world.goal_reached:
        yield "the report says that the goal is reached"
    left = {one.what for one in report.left}
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
    """Return possible external observations: the place of an item, preferably of a moved one.

    Items that the robot handles at the moment are excluded, since the order of the two observations is undefined.
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
