"""The skills of a robot that drives and grasps: a robot with drivers only, and what its devices may refuse."""

from __future__ import annotations

import asyncio

import pytest

from domains.fetch_skills import Hand, Mapper, PathPlanner, Platform
from dsc.calls import SkillCall
from dsc.errors import SkillError
from dsc.text.profiles import Profile
from knowledge_base.facts import Delta, fact
from planning import Robot

PLACES = {"dock": (0.0, 0.0), "shelf": (8.0, 3.0), "desk": (2.0, 6.0)}


class Cart:
    """Drivers with a list of refusals: each device refuses as often as its name is in the list."""

    def __init__(self, *refusals):
        self.at, self.load, self.speeds, self.stopped = PLACES["dock"], None, [], 0
        self.refusals = [*refusals]

    def refuses(self, what):
        if what not in self.refusals:
            return False
        self.refusals.remove(what)
        return True

    async def drive(self, call, stop, speed, avoidance):
        self.speeds.append((speed, avoidance))
        try:
            await call.clock.sleep(10.0)
        except asyncio.CancelledError:
            self.stopped += 1
            raise
        if self.refuses("drive"):
            return "a box is in the way"
        if self.refuses("motor"):
            raise SkillError("no answer of the motor")
        self.at = stop
        return None

    async def path(self, call: SkillCall, target):
        return None if self.refuses("path") else [target]

    async def grasp(self, call, item):
        if self.refuses("grasp"):
            return "it slipped"
        self.load = item
        return None

    async def release(self, call, item, place):
        if self.refuses("release"):
            return "the fingers are stuck"
        self.load = None
        return None


def robot_of(cart, **settings):
    components = [Platform(cart), Mapper(), PathPlanner(cart), Hand(cart)]
    profile = Profile.model_validate({"profile": "cart", **settings})
    robot = Robot.of_bundles(["fetch-skills"], components=components, profile=profile, clock="simulated")
    world = Delta(
        nodes={**dict.fromkeys(PLACES, "location"), "parcel": "item"},
        added=(fact("robot-at", "dock"), fact("item-at", "parcel", "shelf")),
        values={fact("position", name): at for name, at in PLACES.items()},
    )
    robot.knowledge.apply(world, author="test")
    return robot


@pytest.mark.parametrize("refusals", [(), ("drive",), ("path",), ("grasp",), ("release",), ("drive", "drive", "grasp")])
def test_a_robot_with_drivers_only_brings_an_item(refusals):
    cart = Cart(*refusals)
    with robot_of(cart) as robot:
        end = robot.run("bring", {"item": "parcel", "to": "desk"})
        assert end.reached, end
        assert robot.knowledge.query("(robot-at ?l)") == [{"l": "desk"}]
        assert robot.knowledge.ask("(item-at parcel desk)")
    assert (cart.at, cart.load, cart.refusals) == (PLACES["desk"], None, [])


def test_a_robot_that_is_never_there_says_so():
    with robot_of(Cart(*["path"] * 1000)) as robot:
        end = robot.run("move_platform", {"place": "desk"})
        assert [(event.name, event.attributes) for event in end.emitted] == [
            ("not_there", {"reason": "no way leads there"})
        ]
        brought = robot.run("bring", {"item": "parcel", "to": "desk"})
        assert not brought.reached
        assert "(go dock shelf) has failed before" in brought.emitted[-1].attributes["reason"]


def test_a_device_that_fails_is_a_skill_error_and_the_plan_goes_on():
    with robot_of(Cart("motor")) as robot:
        assert robot.run("bring", {"item": "parcel", "to": "desk"}).reached


def test_a_stuck_platform_is_at_no_place():
    with robot_of(Cart("drive")) as robot:
        end = robot.run("move_straight", {"place": "desk"})
        assert end.emitted[-1].attributes == {"reason": "a box is in the way"}
        assert robot.knowledge.query("(robot-at ?l)") == []


def test_a_platform_that_stays_stuck_says_so_after_some_tries():
    cart = Cart(*["drive"] * 1000)
    with robot_of(cart) as robot:
        end = robot.run("move_platform", {"place": "desk", "tries": 4})
        assert end.emitted[-1].attributes == {"reason": "a box is in the way"}
        assert len(cart.speeds) == 4
        assert not robot.run("bring", {"item": "parcel", "to": "desk"}).reached


@pytest.mark.parametrize("plot", ["move_platform", "move_straight"])
def test_a_place_without_a_position_is_not_reached(plot):
    cart = Cart()
    with robot_of(cart) as robot:
        robot.knowledge.apply(Delta(nodes={"lab": "location"}), author="test")
        end = robot.run(plot, {"place": "lab"})
        assert end.emitted[-1].attributes == {"reason": "the place has no position"}
        assert not end.reached
    assert cart.speeds == []


def test_a_path_ends_at_its_target():
    class Short(Cart):
        async def path(self, call, target):
            return []

    cart = Short()
    with robot_of(cart) as robot:
        robot.run("move_platform", {"place": "desk"})
    assert cart.at == PLACES["desk"]


def test_a_path_of_names_is_refused_by_its_form():
    class Named(Cart):
        async def path(self, call, target):
            return ["desk"]

    with robot_of(Named()) as robot:
        end = robot.run("move_platform", {"place": "desk"})
    assert "the stops of a path are pairs (x, y) in metres, not 'desk'" in str(end.reason)


def test_the_profile_limits_the_speed_that_plots_set():
    cart = Cart()
    with robot_of(cart) as robot:
        robot.run("move_platform", {"place": "desk"})
    with robot_of(cart, components={"base": {"fastest": 0.3}}, plots={"move_straight": {"speed": 0.1}}) as robot:
        robot.run("move_platform", {"place": "desk"})
        robot.run("move_straight", {"place": "dock"})
    assert cart.speeds == [(0.6, "narrow"), (0.3, "narrow"), (0.1, "wide")]


def test_a_cancelled_drive_stops_the_platform():
    cart = Cart()
    with robot_of(cart) as robot:
        assert not robot.run("move_platform", {"place": "desk"}, until=5.0).finished
    assert cart.stopped == 1
