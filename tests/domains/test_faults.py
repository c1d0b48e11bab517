"""The clean-up-table world's faults: what fires, when, and for how long."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import pytest
from faulty_world import at_table, put_in_hand, with_fault
from hypothesis import given, settings
from hypothesis import strategies as st

from domains.clean_up_table.world_faults import (
    IN_A_ROW,
    ITEM_ADDED,
    ITEM_MOVED,
    ITEM_SLIPPED,
    KINDS,
    STACK_FELL,
)

if TYPE_CHECKING:
    from domains.clean_up_table.table_world import TableWorld

GRASP_OUTCOMES = {"grasp_failed", "no_ik"}


def play_everything(world: TableWorld) -> None:
    """Verbs in which every kind of fault can happen."""
    world.recognise("look", "table")
    for n in range(6):
        world.pick_up(f"grasp{n}", "cup1", "table")
    for n in range(4):
        world.stack(f"stack{n}", "cup1", "cup2", "table")
        world.pick_up(f"again{n}", "cup1", "table")
    for n in range(5):
        world.pick_up(f"last{n}", "cup3", "table")
        world.drive(f"drive{n}", "sink")


def test_every_kind_of_fault_fires():
    fired: Counter[str] = Counter()
    for seed in range(60):
        world = at_table(seed, 0.5)
        play_everything(world)
        fired.update(fault.kind for fault in world.fired)
    assert set(fired) == set(KINDS)


def test_no_chance_no_fault_and_certainty_always_one():
    world = at_table(1, faults=0.0)
    play_everything(world)
    assert world.fired == []
    world.robot_at = "table"
    assert [world.recognise(f"r{n}", "table").outcome for n in range(2)] == ["recognised"] * 2
    sure = at_table(1, faults=1.0)
    assert sure.recognise("r", "table").outcome == "nothing_found"


def test_a_fault_depends_on_seed_and_action_id_only_not_on_calls_before():
    plain, busy = at_table(5, 0.5), at_table(5, 0.5)
    for n in range(20):
        busy.say(f"x{n}", "hello")
        busy.drive(f"y{n}", "table")
    assert [plain.recognise(f"r{n}", "table") for n in range(20)] == [
        busy.recognise(f"r{n}", "table") for n in range(20)
    ]
    assert plain.fired == busy.fired


def in_a_row(results: list[bool]) -> int:
    longest = current = 0
    for failed in results:
        current = current + 1 if failed else 0
        longest = max(longest, current)
    return longest


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_passing_faults_pass_after_three_in_a_row(seed):
    world = at_table(seed)
    looks = [world.recognise(f"r{n}", "table").outcome == "nothing_found" for n in range(8)]
    assert in_a_row(looks) <= IN_A_ROW
    drives = [world.drive(f"d{n}", ("shelf", "table")[n % 2]).outcome == "no_path" for n in range(16)]
    assert in_a_row(drives[::2]) <= IN_A_ROW
    assert in_a_row(drives[1::2]) <= IN_A_ROW


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_fourth_failed_grasp_in_a_row_proves_it_permanent(seed):
    world = at_table(seed)
    results = [world.pick_up(f"p{n}", "can1", "table") for n in range(8)]
    failures = [r.failures for r in results if r.outcome in GRASP_OUTCOMES]
    if "can1" in world.faults.ungraspable:
        assert failures == list(range(1, 9))
        assert all(r.outcome in GRASP_OUTCOMES for r in results)
        assert world.touched() == {"can1"}
    else:
        assert len(failures) <= IN_A_ROW
        assert failures == list(range(1, len(failures) + 1))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_fourth_failed_drive_in_a_row_proves_it_permanent(seed):
    world = at_table(seed)
    results = [world.drive(f"d{n}", "sink") for n in range(5)]
    if "sink" in world.faults.unreachable:
        assert [r.failures for r in results if r.outcome == "no_path"] == [1, 2, 3, 4, 5]
        assert world.robot_at == "table"
    else:
        assert sum(r.outcome == "no_path" for r in results) <= IN_A_ROW
        assert world.robot_at == "sink"


@pytest.mark.parametrize(
    ("attempt", "succeed"),
    [
        (lambda w, n: w.pick_up(n, "can1", "table"), lambda w: w.put_down("down", "can1", "table")),
        (lambda w, n: w.drive(n, "shelf"), lambda w: w.drive("back", "table")),
        (lambda w, n: w.recognise(n, "table"), lambda w: None),
    ],
)
def test_a_success_ends_the_row_of_failures(attempt, succeed):
    for seed in range(200):
        world = at_table(seed)
        first = attempt(world, "a1")
        world.faults.chance = 0.0
        attempt(world, "a2")
        succeed(world)
        world.faults.chance = 1.0
        second = attempt(world, "a3")
        if first.failures and second.failures and not world.touched():
            assert second.failures == 1
            return
    pytest.fail("no two failures with a success between them")


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_slips_and_falls_stop_after_three_in_a_row(seed):
    world = at_table(seed)
    slips, falls = 0, 0
    while slips <= IN_A_ROW:
        put_in_hand(world, "cup1")
        result = drive_until_moving(world, f"s{slips}", "shelf")
        if result.outcome != "slipped":
            break
        slips += 1
    assert slips == IN_A_ROW
    while falls <= IN_A_ROW:
        put_in_hand(world, "cup1")
        world.items.move(world.items["cup2"], world.robot_at)
        if world.stack(f"f{falls}", "cup1", "cup2", world.robot_at).outcome != "stack_fell":
            break
        falls += 1
    assert falls <= IN_A_ROW


def drive_until_moving(world: TableWorld, prefix: str, to: str):
    world.robot_at = "table"
    for n in range(IN_A_ROW + 1):
        result = world.drive(f"{prefix}-{n}", to)
        if result.outcome != "no_path":
            return result
    raise AssertionError


def test_a_slipped_item_lies_on_the_floor_with_its_contents():
    def play(world: TableWorld) -> None:
        world.items.move(world.items["cup2"], "cup1")
        put_in_hand(world, "cup1")
        world.drive("d", "shelf")

    world = with_fault(ITEM_SLIPPED, permanent=False, play=play)
    assert world.robot_at == "floor"
    assert (world.items["cup1"].where, world.items["cup2"].where) == ("floor", "cup1")
    assert world.fired[-1].items == ("cup1", "cup2")


def test_a_fallen_stack_lies_apart():
    def play(world: TableWorld) -> None:
        world.items.move(world.items["cup2"], "cup1")
        put_in_hand(world, "cup1")
        world.stack("s", "cup1", "cup3", "table")

    world = with_fault(STACK_FELL, permanent=False, play=play)
    assert {item.where for item in world.items if item.kind == "cup"} == {"table"}
    result = world.done["s"]
    assert result.attributes["items"] == ("cup3", "cup1", "cup2")
    assert result.apart == (("cup2", "cup1"),)


def test_an_item_moved_before_the_grasp_is_gone():
    def play(world: TableWorld) -> None:
        world.items["cup1"].seen = True
        world.pick_up("p", "cup1", "table")

    world = with_fault(ITEM_MOVED, permanent=False, play=play)
    assert world.done["p"].outcome == "gone"
    assert world.items["cup1"].where == "shelf"
    assert world.touched() == set()


@pytest.mark.parametrize("kind", [ITEM_MOVED, ITEM_ADDED])
def test_the_carrier_of_the_call_and_unseen_items_are_left_alone(kind):
    def play(world: TableWorld) -> None:
        world.items["cup2"].seen = world.items["cup3"].seen = True
        put_in_hand(world, "cup1")
        world.stack("s", "cup1", "cup2", "table")

    world = with_fault(kind, permanent=False, play=play)
    assert world.done["s"].outcome == "stacked"
    assert world.fired[0].items == (("cup3",) if kind == ITEM_MOVED else (list(world.items)[-1].name,))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_somebody_interferes_a_few_times_only_and_never_while_looking_or_driving(seed):
    world = at_table(seed)
    for n in range(20):
        before = len(world.fired)
        world.recognise(f"r{n}", "table")
        world.drive(f"t{n}", "shelf")
        world.drive(f"u{n}", "table")
        assert not {ITEM_MOVED, ITEM_ADDED} & {fault.kind for fault in world.fired[before:]}
        world.pick_up(f"p{n}", f"cup{n % 3 + 1}", "table")
        world.put_down(f"q{n}", f"cup{n % 3 + 1}", "table")
        world.look_into(f"l{n}", "crisp_can1", "table")
    counts = Counter(fault.kind for fault in world.fired)
    assert counts[ITEM_MOVED] <= 3
    assert counts[ITEM_ADDED] <= 2
    assert len(world.items) == 6 + counts[ITEM_ADDED]
