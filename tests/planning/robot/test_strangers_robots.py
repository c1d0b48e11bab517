"""Robots that are not ours, by every form of target: run, faults, profile, goal, plot, crash and resumption."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dsc import ProgrammingError
from knowledge_base import Delta, InputError, UnknownNameError, fact
from planning import Bundle, Simulation, Task, deploy
from planning.robot.targets import bundle_at
from planning.robot.task import own_task, plot_task

PROJECT = Path(__file__).parents[2] / "support" / "delivery_project"
DSC = Path(sys.executable).with_name("dsc")


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A copy of the project, whose modules are forgotten afterwards."""
    home = tmp_path / "house"
    shutil.copytree(PROJECT, home)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield home
    for name in ("delivery", "robot", "other"):
        sys.modules.pop(name, None)


def dsc(*words, status=0, env=None):
    done = subprocess.run(
        [DSC, *map(str, words)], capture_output=True, text=True, timeout=120, check=False,
        env={**os.environ, **(env or {})},
    )  # fmt: skip
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout if status in {0, 1} else done.stderr


def dsc_both(*words):
    """Return standard output and standard error of a command that succeeds."""
    done = subprocess.run([DSC, *map(str, words)], capture_output=True, text=True, timeout=120, check=True)
    return done.stdout, done.stderr


# -- targets ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["", "delivery.py", "delivery.py:robot"])
def test_a_robot_is_named_by_its_folder_or_its_file(project, form):
    assert bundle_at(str(project / form)).name == "delivery"


def test_a_robot_is_named_by_module_and_name(project, monkeypatch):
    monkeypatch.chdir(project)
    assert bundle_at("delivery:robot").main == "deliver_all"


def test_a_project_with_its_packages_in_src_need_not_be_installed(project):
    (project / "src").mkdir()
    for part in ("delivery.py", "domain.pddl", "plots", "profiles"):
        shutil.move(project / part, project / "src" / part)
    assert bundle_at(str(project)).name == "delivery"


def test_a_folder_without_entry_points_has_a_robot_py(project):
    (project / "pyproject.toml").unlink()
    (project / "delivery.py").rename(project / "robot.py")
    assert bundle_at(str(project)).name == "delivery"


def test_a_file_with_one_bundle_need_not_name_it(tmp_path):
    (tmp_path / "other.py").write_text("from planning import Bundle\nmine = Bundle('mine')\nn = 7\n")
    assert bundle_at(str(tmp_path / "other.py")).name == "mine"
    with pytest.raises(InputError, match=r"other.py:n' leads to 7, not to a Bundle"):
        bundle_at(f"{tmp_path}/other.py:n")
    with pytest.raises(UnknownNameError, match=r"there is no 'mien' in .*did you mean 'mine'"):
        bundle_at(f"{tmp_path}/other.py:mien")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("from planning import Bundle\na, b = Bundle('a'), Bundle('b')\n", r"has 2 bundles; name one as other.py:NAME"),
        ("import os\n", "has no bundle; name one as other.py:NAME, or call it `robot`"),
        ("def robot(\n", r"other.py:1:10: .*cannot be executed: SyntaxError: '\(' was never closed"),
        ("import json\n\nfrom planning import Bundel\n", r"other.py:3: .*from 'planning'; did you mean 'Bundle'"),
        ("robot = 1 / 0\n", r"other.py:1: .*ZeroDivisionError: division by zero"),
        ("def robot():\n    return [][3]\n", r"IndexError: list index out of range \(.*other.py:2\)"),
        ("import json\nrobot = json.loads('{')\n", r"other.py:2: .*JSONDecodeError"),
        ("import sys\nsys.exit(4)\n", r"other.py:2: .*SystemExit: 4"),
    ],
)
def test_an_invalid_bundle_file_is_refused_with_its_cause(tmp_path, text, said):
    (tmp_path / "other.py").write_text(text)
    with pytest.raises(InputError, match=said):
        bundle_at(str(tmp_path / "other.py"))
    sys.modules.pop("other", None)


@pytest.mark.parametrize(
    ("pyproject", "said"),
    [
        ("[project", "this is not a pyproject.toml"),
        ("[project]\nentry-points = 3\n", "this is not a pyproject.toml|are names with MODULE:NAME"),
        ('[project.entry-points."dsc.bundles"]\nd = 7\n', "are names with MODULE:NAME"),
        ('[project.entry-points."dsc.bundles"]\nd = "delivery:rabot"\n', "there is no 'rabot' in the module"),
        ("", "neither an entry point 'dsc.bundles' in its pyproject.toml nor a robot.py"),
    ],
)
def test_an_invalid_bundle_project_is_refused_with_its_cause(project, pyproject, said):
    (project / "pyproject.toml").write_text(pyproject)
    with pytest.raises(InputError, match=said):
        bundle_at(str(project))


def test_an_unknown_robot_is_answered_with_the_nearest_name():
    with pytest.raises(UnknownNameError, match=r"there is no robot 'clean-up-tabel'.*did you mean 'clean-up-table'"):
        bundle_at("clean-up-tabel")


# -- runs ------------------------------------------------------------------------------------------------------


def test_a_project_runs_by_the_command_and_its_world_judges(project):
    report = json.loads(dsc("run", project, "--json"))
    assert (report["robot"], report["goal_reached"], report["judge"], report["left"]) == ("delivery", True, "world", [])
    assert report["delivery"] == {"delivered": ["parcel1", "parcel2"]}
    assert "Goal reached (judge: world)" in dsc("run", project)


def test_a_seed_determines_faults_and_the_report_counts_them(project):
    first, again = (json.loads(dsc("run", project, "--seed", 1, "--faults", 0.5, "--json")) for _ in range(2))
    assert first | {"wall_s": 0} == again | {"wall_s": 0}
    assert {one["kind"] for one in first["faults"]} == {"blocked"}
    assert first["skill_failures"]["blocked"] == len(first["faults"])


def test_a_goal_that_cannot_be_reached_is_reported_with_its_reason(project):
    report = json.loads(dsc("run", project, "--faults", 1, "--json", status=1))
    assert [one["what"] for one in report["left"]] == ["parcel1", "parcel2"]
    assert report["outcome"] == "undelivered"
    assert "Goal not reached: the plot ended with 'undelivered': (drive" in dsc("run", project, "--faults", 1, status=1)


def test_a_profile_sets_parameters(project):
    slow, fast = (json.loads(dsc("run", project, "--json", *more)) for more in ([], ["--profile", "fast"]))
    assert fast["simulated_s"] < slow["simulated_s"] / 3
    assert "did you mean 'fast'" in dsc("run", project, "--profile", "fats", status=2)


def test_a_goal_of_ones_own_is_judged_by_the_knowledge(project):
    report = json.loads(dsc("run", project, "--goal", "(robot-in office)", "--json"))
    assert (report["goal_reached"], report["judge"], report["plans"]) == (True, "knowledge", 1)
    report = json.loads(
        dsc("run", project, "--faults", 1, "--goal", "(and (full) (robot-in office))", "--json", status=1)
    )
    assert [one["what"] for one in report["left"]] == ["(full)", "(robot-in office)"]
    assert "no object 'ofice'" in dsc("run", project, "--goal", "(robot-in ofice)", status=2)


def test_a_plot_runs_with_arguments_that_are_checked_first(project):
    report = json.loads(dsc("run", project, "--plot", "drive", "--with", "to=office", "--json"))
    assert (report["goal_reached"], report["judge"]) == (True, "outcome")
    said = dsc("run", project, "--plot", "drive", "--with", "to=ofice", status=2)
    assert "'drive.to' is of type room, and there is no object 'ofice'; did you mean 'office'?" in said
    said = dsc("run", project, "--plot", "drive", "--with", "to=parcel1", status=2)
    assert "'drive.to' is of type room, and 'parcel1' is of type parcel" in said
    assert "no parameter 'too'; did you mean 'to'" in dsc(
        "run", project, "--plot", "drive", "--with", "too=x", status=2
    )
    assert "no plot 'drve'; did you mean 'drive'" in dsc("run", project, "--plot", "drve", status=2)
    assert "needs" in dsc("run", project, "--plot", "drive", status=2)
    assert "NAME=VALUE" in dsc("run", project, "--plot", "drive", "--with", "to", status=2)


def test_a_trace_and_a_scene_free_world_go_together(project, tmp_path):
    dsc("run", project, "--trace", tmp_path / "t.jsonl", "--json")
    head, *records = [json.loads(line) for line in (tmp_path / "t.jsonl").read_text().splitlines()]
    assert (head["run"], head["seed"], head["faults"]) == ("delivery", 0, 0.0)
    assert records[-1]["type"] == "end"
    assert not any(one["type"] == "scene" for one in records)


def test_options_that_a_robot_does_not_have_are_refused_by_name(project):
    assert "--scenario: the simulation of 'delivery' reads no scenarios" in dsc(
        "run", project, "--scenario", "x.yaml", status=2
    )
    example = Path(__file__).parents[3] / "examples" / "own_domain.py"
    said = dsc("run", example, "--faults", 0.1, "--seed", 2, status=2)
    assert "--seed, --faults: the robot 'gardener' has no simulation" in said


def test_other_commands_take_the_same_targets(project):
    assert "parcel1" in dsc("kb", "query", project, "(in ?p hall)")
    assert "no mistakes found" in dsc("plot", "check", "--robot", project, project / "plots" / "take.yaml")
    wrong = (project / "plots" / "take.yaml").read_text().replace("gripper.grasp", "griper.grasp")
    (project / "plots" / "take.yaml").write_text(wrong)
    done = subprocess.run(
        [DSC, "plot", "check", "--robot", project, project / "plots" / "take.yaml"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (2, "")
    assert (
        "take.yaml:5:16: no component offers the skill or event 'griper.grasp'; did you mean 'gripper.grasp'?"
        in done.stdout
    )


# -- bugs in the robot's code ------------------------------------------------------------------------------


BUGS = {
    "in a skill": ("room = self.house.at[parcel] =", "room = self.hous.at[parcel] =", "gripper.put: AttributeError"),
    "in an outcome": ("Taken(observed", 'Outcome("takn", observed', "gripper.grasp: it ended with 'takn'"),
    "in an observation": ('fact("holding", parcel),)))', 'fact("holds", parcel),)))', "gripper.grasp: there is no predicate 'holds'"),
    "in a fault": ('self.house.fault(call', 'self.house.falt(call', "wheels.drive: AttributeError"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BUGS)
def test_a_bug_ends_the_command_with_status_3_and_its_line(project, kind):
    right, wrong, said = BUGS[kind]
    file = project / "delivery.py"
    text = file.read_text()
    assert right in text
    file.write_text(text.replace(right, wrong, 1))
    done = subprocess.run([DSC, "run", project, "--json"], capture_output=True, text=True, check=False)
    assert done.returncode == 3
    report = json.loads(done.stdout)
    assert said in report["programming_error"]
    assert re.search(r"delivery\.py:\d+\)$", report["programming_error"])
    assert report["goal_reached"] is False
    assert report["skill_failures"].get("programming_error") == 1
    assert done.stderr.count("ERROR dsc.") == 1
    assert ("Traceback" in done.stderr) == ("Error" in said)


def test_the_log_is_as_long_as_the_user_wants_it(project):
    silent = dsc_both("run", project, "-q")
    assert silent[0].startswith("Goal ")
    assert "drives to" not in silent[0]
    assert len(silent[0].splitlines()) < len(dsc_both("run", project)[0].splitlines())
    assert silent[1] == ""
    assert "INFO dsc.components: component 'gripper': alive" in dsc_both("run", project, "-v")[1]


# -- kept runs -------------------------------------------------------------------------------------------------


def test_a_run_without_a_simulation_is_resumed_after_a_crash(tmp_path):
    file = tmp_path / "other.py"
    example = (Path(__file__).parents[3] / "examples" / "own_domain.py").read_text()
    crash = "        import os, pathlib\n        flag = pathlib.Path(__file__).with_name('crashed')\n"
    crash += "        if plant == 'rose' and not flag.exists():\n            flag.touch()\n            os._exit(9)\n"
    file.write_text(
        example.replace("        await call.clock.sleep(5.0)\n", f"        await call.clock.sleep(5.0)\n{crash}")
    )
    dsc("run", file, "--store", tmp_path / "run.kb", status=9)
    assert "unfinished" in dsc("runs", "list", tmp_path / "run.kb")
    report = json.loads(dsc("run", "--resume", tmp_path / "run.kb", "--json").splitlines()[-1])
    assert (report["goal_reached"], report["judge"]) == (True, "knowledge")
    assert "all as they were" in dsc("runs", "replay", tmp_path / "run.kb")


def test_a_world_that_ended_with_its_program_is_not_resumed(project, tmp_path):
    dsc("run", project, "--store", tmp_path / "run.kb", status=9, env={"CRASH": "office"})
    said = dsc("run", "--resume", tmp_path / "run.kb", status=2)
    assert "the simulation of 'delivery' ended with its program; a simulation that lasts sets `lasts = True`" in said
    assert "is of the robot 'delivery', not of 'clean-up-table'" in dsc(
        "run", "clean-up-table", "--resume", tmp_path / "run.kb", status=2
    )


# -- values ----------------------------------------------------------------------------------------------------


def test_a_bundle_without_a_task_says_how_to_give_one():
    with pytest.raises(InputError, match=r"neither `main` nor `goal`: name a plot \(--plot\) or a goal \(--goal\)"):
        own_task(Bundle("parts"))


def test_texts_become_values_of_the_parameters_types(project):
    robot = bundle_at(str(project))
    assert plot_task(robot, "drive", {"to": "office"}) == Task("drive", {"to": "office"})


def test_a_simulation_without_components_cannot_be_made():
    class Empty(Simulation):
        pass

    with pytest.raises(ProgrammingError, match="abstract method components"):
        deploy(Bundle("empty", goal="(and)", simulation=Empty))


def test_the_parts_of_a_goal_that_are_left_are_named_one_by_one(project):
    robot = bundle_at(str(project))
    with deploy(robot, Task(goal="(and (full) (forall (?p - parcel) (imply (in ?p hall) (holding ?p))))")) as deployed:
        deployed.knowledge.apply(Delta(added=(fact("holding", "parcel1"),)), "test")
        report = deployed.report()
    assert [one.what for one in report.left] == ["(full)", "(holding parcel2)"]
    assert not report.goal_reached
