"""The two robots in MuJoCo: laps, contacts, repeatability, and equal paths by the generated controllers."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'dynamic-state-charts[physics]'")

from domains.robots_in_cycles import avoid, follow, line_follower, obstacle_avoider
from domains.robots_in_cycles.drives import HOME, TRACKS
from domains.robots_in_cycles.picture import draw_avoid, draw_follow
from dsc import load_plot
from dsc.controllers import build_controller
from planning import deploy


def generated(name):
    """The cycle of the generated Python controller."""
    names: dict[str, Any] = {}
    exec(build_controller(load_plot(HOME / "plots" / f"{name}.yaml"), "python"), names)  # noqa: S102  what is tested
    controller = names["Controller"]()
    controller.init(names["Host"](), 0)
    return lambda sensors, now: controller.cycle(sensors, int(now * 1e9 + 0.5))


def by_hand(sensors, _now):
    """A proportional controller without states."""
    error = (sensors["left"] - sensors["right"]) / 690
    return {"left_wheel": 6 + 2.5 * error, "right_wheel": 6 - 2.5 * error}


@pytest.mark.parametrize("track", range(len(TRACKS)))
@pytest.mark.parametrize("seed", range(2))
def test_a_lap_of_the_line_follower(track, seed):
    drive = follow(track, seed, 45)
    assert drive.laps > 1
    assert drive.distance < 0.02
    other = follow(track, seed, 45, by_hand)
    assert other.laps > 1
    assert drive.distance < 3 * other.distance


@pytest.mark.parametrize("room", range(5))
def test_no_contact_of_the_obstacle_avoider(room):
    drive = avoid(room, 60)
    assert drive.contacts == 0
    assert drive.metres > 5


def test_a_blind_robot_has_contacts():
    assert avoid(0, 10, lambda *_: {"left_wheel": 6, "right_wheel": 6}).contacts > 0
    assert follow(0, 0, 20, lambda *_: {"left_wheel": 6, "right_wheel": 6}).distance > 0.1


def test_the_generated_controllers_drive_the_same_path():
    assert follow(1, 0, 10, generated("follow_line")).path == follow(1, 0, 10).path
    assert avoid(1, 10, generated("avoid_obstacles")).path == avoid(1, 10).path


@pytest.mark.parametrize(("bundle", "field"), [(line_follower, "laps"), (obstacle_avoider, "metres")])
def test_a_run_with_its_report_is_a_function_of_the_seed(bundle, field):
    reports = []
    for seed in (1, 1, 2):
        with deploy(bundle(), seed=seed) as robot:
            end = robot.run(bundle().main, {"seconds": 10})
            reports.append(robot.simulation.own_report(robot.knowledge, end))
    assert reports[0] == reports[1] != reports[2]
    assert reports[0][field] > 0.2


def test_the_pictures_of_the_page():
    pictures = HOME.parents[1] / "docs" / "pictures"
    for name, svg in (
        ("line_follower", draw_follow(follow(2, 0, 45), 2)),
        ("obstacle_avoider", draw_avoid(avoid(3, 120), 3)),
    ):
        assert svg.count("<") == (pictures / f"{name}.svg").read_text("utf-8").count("<")
