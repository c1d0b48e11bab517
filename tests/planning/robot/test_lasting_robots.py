"""A robot whose simulated world survives a crash: killed and resumed by the command, and judged without false success."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from knowledge_base import InputError
from planning.cli.command import main
from planning.robot import bundles
from planning.robot.targets import bundle_at

FOLDER = Path(__file__).parents[2] / "support" / "lasting_robot"
ROBOT = FOLDER / "robot.py"
GARDENER = Path(__file__).parents[3] / "examples" / "own_domain.py"


@pytest.fixture
def dsc(monkeypatch, capsys):
    """Call the command in this process; return its exit status, standard output and standard error."""
    monkeypatch.setattr(sys, "path", [*sys.path])

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["dsc", *map(str, words)])
        with pytest.raises(SystemExit) as stopped:
            main()
        shown = capsys.readouterr()
        return stopped.value.code or 0, shown.out, shown.err

    yield call
    for name in ("robot", "own_domain", "dying", "moved"):
        sys.modules.pop(name, None)


def ran(dsc, *words):
    status, out, _ = dsc("run", *words, "--json")
    return status, json.loads(out)


def without_wall_time(report):
    return {name: value for name, value in report.items() if name != "wall_s"}


def process(*words, cwd):
    """Call the command in a process of its own, which may be killed."""
    command = [sys.executable, "-c", "from planning.cli.command import main; main()", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, cwd=cwd)


DYING = """
import os, signal, sys
from dataclasses import replace
sys.path.insert(0, {folder!r})
from robot import House, robot as whole


class Dying(House):
    def executed(self, action, outcome):
        super().executed(action, outcome)
        if not self.setup.resumes and len(self.done) == {actions}:
            os.kill(os.getpid(), signal.SIGKILL)


robot = replace(whole, simulation=Dying)
"""


def killed(folder, actions, *options):
    """Run the robot of `dying.py` in a folder with a store, until the process is killed after some actions."""
    (folder / "dying.py").write_text(DYING.format(folder=str(FOLDER), actions=actions))
    done = process("run", "dying.py", "--store", "run.kb", *options, cwd=folder)
    assert done.returncode == -9, done.stderr
    return folder / "run.kb"


@pytest.mark.parametrize("actions", [1, 4, 7])
def test_a_killed_run_is_resumed_by_its_store_alone_and_ends_like_a_whole_run(dsc, tmp_path, actions):
    options = ["--seed", 4, "--faults", 0.5]
    store = killed(tmp_path, actions, *options)
    (tmp_path / "elsewhere").mkdir()
    resumed = process("run", "--resume", store, "--json", cwd=tmp_path / "elsewhere")
    assert (resumed.returncode, resumed.stderr) == (0, "")
    _, whole = ran(dsc, ROBOT, *options, "--store", tmp_path / "whole.kb")
    assert whole["faults"]
    assert without_wall_time(json.loads(resumed.stdout)) == without_wall_time(whole)
    worlds = [json.loads((tmp_path / f"{name}.kb.house").read_text()) for name in ("run", "whole")]
    assert worlds[0] == worlds[1]
    assert dsc("runs", "replay", store)[0] == 0


def test_a_run_whose_robot_has_moved_is_resumed_by_a_target(dsc, tmp_path):
    store = killed(tmp_path, 2)
    (tmp_path / "dying.py").rename(tmp_path / "moved.py")
    status, _, err = dsc("run", "--resume", store)
    assert status == 2
    assert "dying.py: there is no such file" in err
    status, _, err = dsc("run", GARDENER, "--resume", store)
    assert status == 2
    assert "of the robot 'porter', not of 'gardener'" in err
    status, report = ran(dsc, tmp_path / "moved.py", "--resume", store)
    assert (status, report["goal_reached"], report["judge"]) == (0, True, "world")


def test_a_resumed_run_keeps_its_goal_and_its_judge(dsc, tmp_path):
    store = killed(tmp_path, 1, "--goal", "(and (cart-in ward) (loaded pills))")
    status, _, err = dsc("run", "--resume", store, "--goal", "(cart-in lab)", "--seed", 2)
    assert status == 2
    assert "without --goal, --seed" in err
    status, report = ran(dsc, "--resume", store)
    assert (status, report["goal_reached"], report["judge"]) == (0, True, "knowledge")


def test_a_plot_that_ends_with_a_failure_claims_no_success(dsc):
    words = (ROBOT, "--plot", "load", "--with", "parcel=pills", "--with", "room=hall")
    status, report = ran(dsc, *words, "--faults", 1)
    assert (status, report["judge"], report["goal_reached"], report["outcome"]) == (1, "outcome", False, "jammed")
    assert ran(dsc, *words)[1]["goal_reached"] is True
    assert "the plot ended with 'jammed'" in dsc("run", *words, "--faults", 1)[1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["times=4"], "'beep.times' is from 1 to 3; found 4"),
        (["times=two"], "found the text two"),
        (["times=nan"], "'beep.times' is from 1 to 3; found nan"),
        (["times="], "'beep.times' is a number, from 1 to 3; found the text"),
        (["times=2", "loud=yes"], "'beep.loud' is a boolean; found yes"),
    ],
)
def test_a_text_that_is_no_value_of_the_parameter_is_refused(dsc, words, said):
    status, out, err = dsc("run", ROBOT, "--plot", "beep", *(part for one in words for part in ("--with", one)))
    assert (status, out) == (2, "")
    assert said in err


def test_numbers_and_truth_values_reach_the_plot(dsc):
    status, report = ran(dsc, ROBOT, "--plot", "beep", "--with", "times=3", "--with", "loud=true")
    assert (status, report["simulated_s"]) == (0, 3.0)


def test_a_permanent_fault_leaves_what_the_world_says(dsc):
    status, report = ran(dsc, ROBOT, "--faults", 1)
    assert (status, report["goal_reached"], report["judge"]) == (1, False, "world")
    assert {(one["what"], one["where"]) for one in report["left"]} == {("blood", "hall"), ("pills", "hall")}
    assert all(one["reason"] for one in report["left"])


def test_texts_that_a_robot_prints_are_no_part_of_its_report(dsc):
    status, out, err = dsc("run", GARDENER, "--json")
    assert (status, json.loads(out)["goal_reached"]) == (0, True)
    assert "watered the rose" in err
    assert "watered the rose" in dsc("run", GARDENER)[1]


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("unreadable.py", "unreadable.py:2:11: "),
        ("unreadable:robot", "unreadable.py:2:11: "),
        ("no_module:robot", "'no_module'"),
    ],
)
def test_an_error_has_the_line_of_the_user_and_none_of_the_interpreter(tmp_path, monkeypatch, target, said):
    (tmp_path / "unreadable.py").write_text("x = 1\ndef robot(:\n")
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=said) as refused:
        bundle_at(target)
    assert "<frozen" not in str(refused.value)


def test_a_robot_of_an_installed_package_runs_by_its_name(dsc, monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    point = EntryPoint("porter", "robot:robot", bundles.GROUP)
    monkeypatch.setattr(bundles, "entry_points", lambda group: [point] if group == bundles.GROUP else [])
    assert ran(dsc, "porter")[1]["goal_reached"] is True
    status, _, err = dsc("run", "portr")
    assert status == 2
    assert "did you mean 'porter'?" in err


def test_a_robot_runs_in_the_present_folder(dsc, monkeypatch):
    monkeypatch.chdir(FOLDER)
    assert ran(dsc, ".")[1]["porter"] == {"delivered": 2}
