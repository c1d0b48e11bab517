"""The robot in its simulated house; a run takes simulated time only."""

import pytest
from my_robot.robot import robot

from planning import Task, deploy


def test_all_parcels_are_delivered() -> None:
    with deploy(robot) as deployed:
        report = deployed.report()
    assert report.goal_reached, report.headline
    assert report.plans == 1


@pytest.mark.parametrize("seed", range(5))
def test_closed_doors_are_tried_again(seed: int) -> None:
    with deploy(robot, seed=seed, faults=0.3) as deployed:
        report = deployed.report()
    assert report.goal_reached, report.headline
    assert report.skill_failures.get("door_closed", 0) == len(report.faults)


def test_a_goal_is_enough() -> None:
    with deploy(robot, Task(goal="(and (robot-in office) (carries book))")) as deployed:
        assert deployed.report().goal_reached
