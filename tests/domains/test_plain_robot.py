"""The world judged as a whole: a robot with plain rules, no plots and no plans, clears the table.

It tries everything four times, gives it up then, and looks round until there is nothing left to do.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from reporting_robot import Robot, believes_the_truth

import domains.clean_up_table
from domains.clean_up_table.items import DESTINATION_OF, SURFACES
from domains.clean_up_table.scenario import Scenario
from domains.clean_up_table.world_faults import KINDS, NO_PATH, NOTHING_FOUND
from knowledge_base.facts import fact
from knowledge_base.pddl.domain_text import parse_domain

DOMAIN_FILE = Path(domains.clean_up_table.__file__).with_name("domain.pddl")
DOMAIN = parse_domain(DOMAIN_FILE.read_text(encoding="utf-8"))


def clear(robot: Robot) -> None:
    for _ in range(60):
        if not round_trip(robot):
            return
    pytest.fail("the robot never came to an end")


def round_trip(robot: Robot) -> bool:
    """Look at every surface and handle the first item that can be; whether there was one."""
    for surface in SURFACES:
        go(robot, surface)
        while robot.do("recognise", surface=surface).event == "nothing_found":
            pass
        for item in robot.lying(surface):
            if handle(robot, item, surface):
                return True
    return False


def handle(robot: Robot, item: str, surface: str) -> bool:
    (destination,) = [f.args[1] for f in robot.facts if f.predicate == "goes-to" and f.args[0] == item]
    inside = robot.all("inside", item)
    if fact("graspable", item) not in robot.facts:
        return any(grasp(robot, "take_out", item=one, carrier=item, surface=surface) for one in inside)
    if fact("passable", destination) not in robot.facts:
        return False
    if not grasp(robot, "pick_up", item=item, surface=surface):
        return True
    for carrier in sorted(str(f.args[1]) for f in robot.facts if f.predicate == "fits" and f.args[0] == item):
        usable = carrier in robot.lying(surface) and fact("free-room", carrier, "none") not in robot.facts
        if usable and fact("graspable", carrier) in robot.facts:
            robot.do("stack", item=item, carrier=carrier, surface=surface)
            return put_away(robot)
    return put_away(robot)


def grasp(robot: Robot, skill: str, **where: str) -> bool:
    """Grasp, and give an item up after the fourth failure in a row; whether it is in the hand."""
    item = where["item"]
    while fact("graspable", item) in robot.facts:
        event = robot.do(skill, **where).event
        if event in {"picked_up", "taken_out"}:
            return put_away(robot) if skill == "take_out" else True
        if event not in {"grasp_failed", "no_ik"}:
            return False
        failures = robot.values[fact("failures", item)]
        assert isinstance(failures, int | float)
        if failures > 3:
            robot.facts.discard(fact("graspable", item))
    return False


def put_away(robot: Robot) -> bool:
    """Bring what is in the hand where it goes, or put it down where the robot is."""
    for item in robot.all("holding"):
        (destination,) = [str(f.args[1]) for f in robot.facts if f.predicate == "goes-to" and f.args[0] == item]
        if go(robot, destination):
            assert robot.do("throw_away", item=item, destination=destination).event == "thrown_away"
        elif robot.all("holding"):
            go(robot, "shelf")
            for held in robot.all("holding"):
                robot.do("put_down", item=held, surface="shelf")
    return True


def go(robot: Robot, place: str) -> bool:
    """Drive until there, or until the item slipped or the way is given up."""
    while fact("passable", place) in robot.facts:
        event = robot.do("drive", to=place).event
        if event != "no_path":
            return event == "arrived"
        detours = robot.values[fact("detours", place)]
        assert isinstance(detours, int | float)
        if detours > 3:
            robot.facts.discard(fact("passable", place))
    return False


@pytest.mark.parametrize("faults", [0.0, 0.2, 0.6, 1.0])
def test_a_robot_with_plain_rules_leaves_exactly_what_permanent_faults_touched(faults):
    fired: set[str] = set()
    for seed in range(25):
        robot = Robot(Scenario.default().world(seed, faults))
        clear(robot)
        world = robot.world
        fired |= {fault.kind for fault in world.fired}
        believes_the_truth(robot)
        assert {left.item for left in world.left()} == world.touched(), seed
        assert {left.item for left in world.left() if left.reason} == world.touched()
        assert world.goal_reached or any(fault.permanent for fault in world.fired)
    assert fired == (set(KINDS) if faults else set())


def test_the_same_seed_gives_the_same_run():
    runs = []
    for _ in range(2):
        robot = Robot(Scenario.default().world(11, 0.3))
        clear(robot)
        runs.append((robot.world.state(), robot.facts, robot.clock.time))
    assert runs[0] == runs[1]
    assert {fault.kind for fault in robot.world.fired} & {NO_PATH, NOTHING_FOUND}


def test_everything_reported_is_declared_in_the_domain():
    signatures = {one.name: len(one.parameters) for one in (*DOMAIN.predicates, *DOMAIN.functions)}
    for seed in range(15):
        robot = Robot(Scenario.default().world(seed, 0.4))
        clear(robot)
        for one in (*robot.facts, *robot.values):
            assert signatures[one.predicate] == len(one.args)
        assert set(robot.types.values()) <= {"room", "surface", "destination", "place", *DESTINATION_OF}
