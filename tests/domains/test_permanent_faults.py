"""Faults that never pass: what they touch, and that nothing else is blamed on them."""

from __future__ import annotations

import pytest
from faulty_world import at_table, make_world, put_in_hand, with_fault

from domains.clean_up_table.items import new_item
from domains.clean_up_table.table_world import TableWorld
from domains.clean_up_table.world_faults import GRASP_FAILED, NO_INVERSE_KINEMATICS, NO_PATH, NOTHING_FOUND


@pytest.mark.parametrize("kind", [GRASP_FAILED, NO_INVERSE_KINEMATICS])
def test_a_permanent_grasp_fault_touches_its_item_for_ever(kind):
    world = with_fault(kind, permanent=True, play=lambda w: w.pick_up("p", "can1", "table"))
    assert world.touched() == {"can1"}
    world.faults.chance = 0.0
    outcome = {GRASP_FAILED: "grasp_failed", NO_INVERSE_KINEMATICS: "no_ik"}[kind]
    assert [world.pick_up(f"p{n}", "can1", "table").outcome for n in range(5)] == [outcome] * 5
    assert {left.item for left in world.left() if left.reason} == {"can1"}


def test_a_touched_item_that_goes_with_its_carrier_is_touched_no_more():
    world = with_fault(GRASP_FAILED, permanent=True, play=take_out_of_a_carrier)
    assert world.touched() == {"cup1"}
    world.faults.chance = 0.0
    put_in_hand(world, "cup2")
    world.robot_at = "sink"
    assert world.throw_away("away", "cup2", "sink").outcome == "thrown_away"
    assert world.touched() == set()


def take_out_of_a_carrier(world: TableWorld) -> None:
    world.items.move(world.items["cup1"], "cup2")
    world.take_out("t", "cup1", "cup2", "table")


def test_an_unrecognisable_item_is_neither_seen_nor_found_any_more():
    world = with_fault(NOTHING_FOUND, permanent=True, play=lambda w: w.recognise("r", "table"))
    (lost,) = world.touched()
    world.faults.chance = 0.0
    seen = {sighting.item for sighting in world.recognise("r2", "table").sightings}
    assert seen == {item.name for item in world.items} - {lost}
    assert world.pick_up("p", lost, "table").outcome == "gone"
    assert [left.reason for left in world.left() if left.item == lost] == ["it cannot be recognised"]


def test_a_carrier_with_contents_stays_recognisable():
    for seed in range(300):
        world = at_table(seed)
        for name in ("cup2", "can1", "can2"):
            world.items.move(world.items[name], "shelf")
        world.items.move(world.items["crisp_can1"], "shelf")
        world.items.move(world.items["cup1"], "cup3")
        world.recognise("r", "table")
        assert world.touched() == set()


def test_a_lost_way_touches_all_that_goes_there_also_what_comes_later():
    world = with_fault(NO_PATH, permanent=True, play=lambda w: w.drive("d", "sink"))
    assert world.touched() == {"cup1", "cup2", "cup3"}
    assert world.fired[-1].items == ("cup1", "cup2", "cup3")
    world.add_item("cup", "late")
    assert "late" in world.touched()
    assert {left.reason for left in world.left()} == {"no path leads to the sink", None}


def test_surfaces_and_the_operator_stay_reachable():
    for seed in range(400):
        world = make_world(seed)
        for n, place in enumerate(("table", "shelf", "floor", "operator") * 2):
            world.drive(f"d{n}", place)
        assert world.faults.unreachable == []


def test_an_item_hidden_behind_a_touched_item_is_touched():
    back, rear = new_item("cup", "back", behind="front"), new_item("cup", "rear", behind="back")
    world = TableWorld([new_item("can", "front"), back, rear])
    world.faults.ungraspable["front"] = GRASP_FAILED
    assert world.touched() == {"front", "back", "rear"}
    reasons = [left.reason for left in world.left()]
    assert reasons[1:] == ["it is hidden behind front", "it is hidden behind back"]
    world.move_item("front", "shelf")
    assert world.touched() == {"front"}


def test_an_item_in_a_carrier_stuck_in_another_carrier_is_touched():
    world = at_table(0, faults=0.0)
    world.items.move(world.items["cup1"], "cup2")
    world.items.move(world.items["cup2"], "cup3")
    world.faults.ungraspable["cup2"] = GRASP_FAILED
    assert world.touched() == {"cup2"}
    world.faults.ungraspable["cup3"] = NO_INVERSE_KINEMATICS
    assert world.touched() == {"cup1", "cup2", "cup3"}
    assert world.left()[0].reason == "it is in cup2, which is stuck in cup3"
    del world.faults.ungraspable["cup2"]
    assert world.touched() == {"cup3"}


def test_about_an_eighth_of_grasp_faults_is_permanent():
    fired = []
    for seed in range(1500):
        world = at_table(seed)
        world.pick_up("p", "can1", "table")
        fired += [fault for fault in world.fired if fault.kind in {GRASP_FAILED, NO_INVERSE_KINEMATICS}]
    share = sum(fault.permanent for fault in fired) / len(fired)
    assert 0.08 < share < 0.16
