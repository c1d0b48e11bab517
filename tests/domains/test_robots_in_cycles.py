"""The two robots in MuJoCo: laps, contacts, repeatability, and equal paths by the generated controllers."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'dynamic-state-charts[physics]'")

import numpy as np
from PIL import Image, ImageSequence

from domains.robots_in_cycles import avoid, follow, line_follower, obstacle_avoider
from domains.robots_in_cycles.drives import HOME, TRACKS, RoomCourse, controller_of
from domains.robots_in_cycles.film import Film
from domains.robots_in_cycles.picture import draw_avoid, draw_follow
from dsc import load_plot
from dsc.controllers import build_controller
from knowledge_base import InputError
from planning import deploy

CC, ROOT = shutil.which("cc"), Path(__file__).parents[2]


def generated(name):
    """The cycle of the generated Python controller."""
    names: dict[str, Any] = {}
    exec(build_controller(load_plot(HOME / "plots" / f"{name}.yaml"), "python"), names)  # noqa: S102  what is tested
    controller = names["Controller"]()
    controller.init(names["Host"](), 0)
    return lambda sensors, now: controller.cycle(sensors, int(now * 1e9 + 0.5))


def compiled(name, folder):
    """The cycle of the generated C controller as a shared library; all its sensors and motors are doubles."""
    plot = load_plot(HOME / "plots" / f"{name}.yaml")
    (folder / f"{name}.c").write_text(build_controller(plot, "c99"))
    flags = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-ffp-contract=off")
    subprocess.run(
        [str(CC), *flags, "-shared", "-fPIC", "-o", f"{name}.so", f"{name}.c"], check=True, cwd=folder, timeout=60
    )
    library = ctypes.CDLL(str(folder / f"{name}.so"))
    controller, host = ctypes.create_string_buffer(1 << 20), (ctypes.c_void_p * 5)()
    assert library[f"{name}_init"](controller, host, None, ctypes.c_int64(0)) == 0
    sensors, motors = (ctypes.c_double * len(plot.robot.sensors))(), (ctypes.c_double * len(plot.robot.motors))()

    def cycle(values, now):
        sensors[:] = [values[one] for one in plot.robot.sensors]
        assert library[f"{name}_cycle"](controller, sensors, ctypes.c_int64(int(now * 1e9 + 0.5)), motors) == 0
        return dict(zip(plot.robot.motors, motors, strict=True))

    return cycle


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


def test_the_generated_python_controllers_drive_the_same_path():
    assert follow(1, 0, 10, generated("follow_line")).path == follow(1, 0, 10).path
    assert avoid(1, 10, generated("avoid_obstacles")).path == avoid(1, 10).path


@pytest.mark.skipif(CC is None, reason="there is no C compiler `cc`")
@pytest.mark.parametrize("track", range(len(TRACKS)))
def test_the_generated_c_controllers_drive_the_same_path(track, tmp_path):
    path = follow(track, 0, 20, compiled("follow_line", tmp_path)).path
    assert path == follow(track, 0, 20).path
    assert len(path) == 626
    assert avoid(track, 10, compiled("avoid_obstacles", tmp_path)).path == avoid(track, 10).path


def test_another_speed_drives_another_path():
    """The comparison of paths sees a difference of one part in a million."""
    drive = controller_of("follow_line").step
    assert (
        follow(1, 0, 10).path
        != follow(1, 0, 10, lambda *given: {k: v * (1 + 1e-6) for k, v in drive(*given).items()}).path
    )


@pytest.mark.parametrize("track", [-1, len(TRACKS), "x", 1.5])
def test_tracks_that_do_not_exist(track):
    with deploy(line_follower()) as robot, pytest.raises(InputError, match=r"'line_follower\.track' is .*integer"):
        robot.run("line_follower", {"track": track})


def test_the_range_of_tracks_is_that_of_the_tracks():
    parameter = load_plot(HOME / "line_follower.yaml").parameters["track"]
    assert (parameter.least, parameter.most) == (0, len(TRACKS) - 1)


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


def test_a_film_of_a_drive(tmp_path):
    words = ("run", "obstacle-avoider", "--with", "seconds=2", "--with", "film=drive.webp")
    run = subprocess.run(
        [sys.executable, "-c", "from planning.cli.command import main; main()", *words],
        cwd=tmp_path, env={**os.environ, "MUJOCO_GL": "egl", "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        timeout=120, check=False,
    )  # fmt: skip
    if "cannot draw on this machine" in run.stdout:
        pytest.skip(run.stdout)
    assert run.returncode == 0, run.stdout + run.stderr
    with Image.open(tmp_path / "drive.webp") as film:
        frames = [one.convert("RGB").tobytes() for one in ImageSequence.Iterator(film)]
        assert (film.size, len(frames), len(set(frames))) == ((320, 240), 32, 32)


@pytest.mark.parametrize(
    ("film", "said"),
    [
        ("drive.mp4", "a film is a file with one of the suffixes .webp, .gif, .png, but was 'drive.mp4'"),
        ("missing/drive.gif", "the folder of the film 'missing/drive.gif' does not exist: create it, or"),
    ],
)
@pytest.mark.parametrize("bundle", [line_follower, obstacle_avoider])
def test_refused_films(bundle, film, said):
    with deploy(bundle()) as robot:
        end = robot.run(bundle().main, {"film": film})
    assert not end
    assert end.reason.startswith(f"the plot ended with 'did_not_drive': {said}")


def test_the_frames_of_a_long_film(monkeypatch):
    """A film has at most 600 frames."""
    film = Film(HOME / "drive.gif", 3600)
    course = RoomCourse(0, lambda *_: {"left_wheel": 0, "right_wheel": 0})
    monkeypatch.setattr(course.rover, "picture", lambda: np.zeros((240, 320, 3), np.uint8))
    for _ in range(3 * 188):
        film.watch(course)
    assert len(film._frames) == 3
