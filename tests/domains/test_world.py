"""The clean-up-table world without faults: what verbs do, impossible calls, truth, drawing."""

from __future__ import annotations

import json

import pytest
from small_table import NAMES, make_world

from domains.clean_up_table.items import HAND, OPERATOR, PLACES, new_item
from domains.clean_up_table.table_world import TableWorld
from knowledge_base.errors import InputError


class Robot:
    """Calls verbs with action ids of its own: a1, a2, …"""

    def __init__(self, world: TableWorld) -> None:
        self.world = world
        self.count = 0

    def __getattr__(self, verb: str):
        def call(*args: str):
            self.count += 1
            return getattr(self.world, verb)(f"a{self.count}", *args)

        return call


@pytest.fixture
def world() -> TableWorld:
    return make_world()


@pytest.fixture
def robot(world: TableWorld) -> Robot:
    robot = Robot(world)
    robot.drive("table")
    return robot


def outcomes(robot: Robot, *calls: tuple[str, ...]) -> list[str]:
    return [getattr(robot, verb)(*args).outcome for verb, *args in calls]


def test_cups_nest_and_are_thrown_away_together(world, robot):
    assert outcomes(
        robot,
        ("pick_up", "cup1", "table"),
        ("stack", "cup1", "cup2", "table"),
        ("pick_up", "cup2", "table"),
        ("stack", "cup2", "cup3", "table"),
        ("pick_up", "cup3", "table"),
        ("drive", "sink"),
        ("throw_away", "cup3", "sink"),
    ) == ["picked_up", "stacked", "picked_up", "stacked", "picked_up", "arrived", "thrown_away"]
    assert world.trips == 1
    assert [left.item for left in world.left()] == ["can1", "can2", "crisp_can1", "crisp_can2"]
    assert all(world.items[name].where == "sink" for name in ("cup1", "cup2", "cup3"))


def test_a_crisp_can_takes_as_many_cans_as_it_has_room(robot):
    assert outcomes(
        robot,
        ("pick_up", "can1", "table"),
        ("stack", "can1", "crisp_can1", "table"),
        ("pick_up", "can2", "table"),
        ("stack", "can2", "crisp_can1", "table"),
        ("stack", "can2", "crisp_can2", "table"),
        ("take_out", "can1", "crisp_can1", "table"),
        ("stack", "can1", "crisp_can2", "table"),
    ) == ["picked_up", "stacked", "picked_up", "not_possible", "stacked", "taken_out", "stacked"]


def test_room_is_counted_down_by_stacking_and_looking_and_up_by_taking_out(robot):
    robot.pick_up("can1", "table")
    rooms = [
        robot.stack("can1", "crisp_can2", "table"),
        robot.look_into("crisp_can2", "table"),
        robot.look_into("crisp_can2", "table"),
        robot.take_out("can1", "crisp_can2", "table"),
    ]
    assert [result.sightings[0].room for result in rooms] == ["one", "none", "none", "one"]
    seen = {sighting.item: sighting.room for sighting in robot.recognise("table").sightings}
    assert seen["crisp_can2"] == "one"  # what was given up stays given up, however often it is looked at


@pytest.mark.parametrize(
    ("call", "outcome"),
    [
        (("drive", "moon"), "not_possible"),
        (("drive", "table"), "arrived"),
        (("pick_up", "ghost", "table"), "gone"),
        (("pick_up", "cup1", "shelf"), "not_possible"),
        (("pick_up", "cup1", "sink"), "not_possible"),
        (("pick_up", "cup1", "moon"), "not_possible"),
        (("put_down", "cup1", "table"), "not_possible"),
        (("stack", "cup1", "cup2", "table"), "not_possible"),
        (("take_out", "cup1", "cup2", "table"), "not_possible"),
        (("take_out", "cup1", "ghost", "table"), "gone"),
        (("look_into", "ghost", "table"), "gone"),
        (("look_into", "can1", "shelf"), "not_possible"),
        (("throw_away", "cup1", "sink"), "not_possible"),
        (("throw_away", "cup1", "table"), "not_possible"),
        (("recognise", "sink"), "not_possible"),
        (("recognise", "shelf"), "not_possible"),
    ],
)
def test_an_impossible_call_says_so_and_changes_nothing(world, robot, call, outcome):
    before = world.state()
    assert outcomes(robot, call) == [outcome]
    assert {**world.state(), "done": None} == {**before, "done": None}


@pytest.mark.parametrize(
    "call",
    [
        ("pick_up", "cup2", "table"),
        ("put_down", "cup2", "table"),
        ("stack", "cup1", "cup1", "table"),
        ("stack", "cup1", "crisp_can1", "table"),
        ("stack", "cup2", "cup3", "table"),
        ("look_into", "cup1", "table"),
        ("take_out", "can1", "crisp_can1", "table"),
    ],
)
def test_a_full_hand_makes_calls_impossible(world, robot, call):
    robot.pick_up("cup1", "table")
    before = world.state()
    assert outcomes(robot, call) == ["not_possible"]
    assert {**world.state(), "done": None} == {**before, "done": None}


def test_an_item_inside_another_item_cannot_be_picked_up(robot):
    robot.pick_up("cup1", "table")
    robot.stack("cup1", "cup2", "table")
    assert robot.pick_up("cup1", "table").outcome == "not_possible"


def test_nothing_goes_into_the_wrong_destination(world, robot):
    robot.pick_up("cup1", "table")
    robot.drive("bin")
    result = robot.throw_away("cup1", "bin")
    assert result.outcome == "not_possible"
    assert "bin" in result.attributes["reason"]
    assert world.trips == 0


def test_an_item_somebody_moved_is_gone(world, robot):
    world.move_item("cup1", "shelf")
    result = robot.pick_up("cup1", "table")
    assert (result.outcome, result.attributes) == ("gone", {"item": "cup1", "surface": "table"})
    robot.pick_up("cup2", "table")
    assert robot.stack("cup2", "cup1", "table").attributes == {"item": "cup1", "surface": "table"}
    assert world.items.held.name == "cup2"


def test_a_hidden_item_is_seen_once_the_one_before_it_is_away(robot):
    assert "can2" not in {sighting.item for sighting in robot.recognise("table").sightings}
    robot.pick_up("crisp_can2", "table")
    second = {sighting.item: sighting.new for sighting in robot.recognise("table").sightings}
    assert second["can2"]
    assert not second["cup1"]


def test_fits_are_reported_once_and_never_for_an_item_and_itself(robot):
    first = robot.recognise("table")
    assert set(first.fits) == {
        *((a, b) for a in ("cup1", "cup2", "cup3") for b in ("cup1", "cup2", "cup3") if a != b),
        ("can1", "crisp_can1"),
        ("can1", "crisp_can2"),
    }
    assert len(set(first.fits)) == len(first.fits)
    robot.world.add_item("cup")
    later = robot.recognise("table")
    new = {("cup4", old) for old in ("cup1", "cup2", "cup3")}
    assert set(later.fits) == new | {(old, cup) for cup, old in new}


def test_room_that_is_taken_cannot_be_given_up_too(world, robot):
    for _ in range(3):
        robot.look_into("crisp_can2", "table")
    robot.pick_up("can1", "table")
    robot.stack("can1", "crisp_can2", "table")
    assert robot.take_out("can1", "crisp_can2", "table").sightings[0].room == "one"


def test_a_discarded_item_is_in_no_pair_of_fitting_items(robot):
    robot.recognise("table")
    robot.pick_up("cup1", "table")
    robot.drive("sink")
    robot.throw_away("cup1", "sink")
    robot.world.add_item("cup")
    robot.drive("table")
    assert {"cup1"}.isdisjoint(name for pair in robot.recognise("table").fits for name in pair)


def test_contents_are_seen_through_their_carriers(robot):
    robot.pick_up("cup1", "table")
    robot.stack("cup1", "cup2", "table")
    robot.pick_up("cup2", "table")
    robot.stack("cup2", "cup3", "table")
    result = robot.recognise("table")
    where = {sighting.item: sighting.where for sighting in result.sightings}
    assert (where["cup1"], where["cup2"], where["cup3"]) == ("cup2", "cup3", "table")
    assert result.attributes["count"] == 4  # cup3, can1 and the crisp cans; can2 is hidden


def test_the_goal_counts_what_ever_stood_on_the_table(world):
    world = TableWorld([new_item("cup", "cup1", surface="shelf")])
    assert world.goal_reached
    world.move_item("cup1", "table")
    assert not world.goal_reached
    world.move_item("cup1", "floor")
    assert [(left.item, left.where, left.reason) for left in world.left()] == [("cup1", "floor", None)]


def test_an_item_that_reaches_the_table_inside_another_item_counts_as_left():
    world = TableWorld([new_item("cup", "cup1", surface="shelf"), new_item("cup", "cup2", surface="shelf")])
    world.items.move(world.items["cup1"], "cup2")
    world.move_item("cup2", "table")
    assert [left.item for left in world.left()] == ["cup1", "cup2"]


def test_left_says_where_an_item_is(world, robot):
    robot.pick_up("cup1", "table")
    robot.stack("cup1", "cup2", "table")
    robot.pick_up("can1", "table")
    where = {left.item: left.where for left in world.left()}
    assert (where["cup1"], where["cup2"], where["can1"]) == ("in cup2", "table", HAND)


def test_somebody_adds_items_under_free_names(world):
    assert world.add_item("cup") == "cup4"
    assert world.add_item("crisp-can", size="large") == "crisp_can3"
    assert world.add_item("can", "coke", "shelf") == "coke"


@pytest.mark.parametrize(
    ("attempt", "nearest"),
    [
        (lambda w: w.add_item("cupp"), "cup"),
        (lambda w: w.add_item("cup", surface="shelv"), "shelf"),
        (lambda w: w.add_item("crisp-can", size="larg"), "large"),
        (lambda w: w.add_item("can", behind="cup11"), "cup1"),
        (lambda w: w.add_item("can", "cup1"), None),
        (lambda w: w.add_item("can", "table"), None),
        (lambda w: w.add_item("can", "Cola can"), "cola_can"),
        (lambda w: w.move_item("cup11", "shelf"), "cup1"),
        (lambda w: w.move_item("cup1", "shelv"), "shelf"),
        (lambda w: TableWorld(robot_at="tabel"), "table"),
        (lambda w: TableWorld(faults=1.5), None),
        (lambda w: TableWorld(faults=float("nan")), None),
        (lambda w: TableWorld([new_item("cup", "a"), new_item("cup", "a")]), None),
        (lambda w: TableWorld([new_item("cup", "a", behind="b"), new_item("cup", "b", behind="a")]), None),
        (lambda w: TableWorld.from_state({}), None),
        (lambda w: TableWorld.from_state({**w.state(), "done": {"a": {}}}), None),
    ],
)
def test_a_mistake_is_an_input_error_and_changes_nothing(world, attempt, nearest):
    before = world.state()
    with pytest.raises(InputError) as caught:
        attempt(world)
    assert caught.value.nearest == nearest
    assert world.state() == before


def test_only_an_item_on_a_surface_is_moved_by_somebody(world, robot):
    robot.pick_up("cup1", "table")
    with pytest.raises(InputError, match="hand"):
        world.move_item("cup1", "shelf")


def test_two_worlds_of_one_list_do_not_share_items():
    items = [new_item("cup", "cup1")]
    TableWorld(items).move_item("cup1", "shelf")
    assert TableWorld(items).items["cup1"].where == "table"


def test_the_scene_has_every_place_the_robot_and_every_item_inside_its_holder(world, robot):
    robot.pick_up("cup1", "table")
    robot.stack("cup1", "cup2", "table")
    robot.pick_up("cup2", "table")
    drawn = {entry["id"]: entry for entry in world.scene()}
    assert set(drawn) == {*PLACES, "robot", *NAMES}
    assert all({"id", "shape", "x", "y", "label"} <= set(entry) for entry in drawn.values())
    assert (drawn["cup1"]["in"], drawn["cup2"]["in"]) == ("cup2", "robot")
    assert (drawn["cup1"]["x"], drawn["cup1"]["y"]) == (drawn["robot"]["x"], drawn["robot"]["y"])
    json.dumps(world.scene())


def test_items_on_a_surface_are_drawn_apart(world):
    spots = [(e["x"], e["y"]) for e in world.scene() if e["id"] in NAMES]
    assert len(set(spots)) == len(NAMES)


def test_the_robot_starts_at_the_operator(world):
    assert world.robot_at == OPERATOR
    assert world.items.held is None
