"""`dsc deployment`: a model is compared with its robot, drawn, and simulated."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from planning.cli.command import app

ROBOT = """
from dsc import Component, Push, Stream
from planning import Bundle, PlanningDomain


class Laser(Component):
    demands = {"": {"hardware": ["laser"], "tasks": {"scan": {"period": 0.05, "worst_case": 0.008}}}}
    scan = Push({"metres": "number"})


class Mapper(Component):
    name = "mapper"
    demands = {"": {"resources": {"memory": 200}}, "mapping": {"resources": {"memory": 600}}}
    modes = ("mapping", "parked")
    needs = {"mapping": ("scan",)}
    scan = Stream({"metres": "number"})


def bundle():
    return Bundle("lasers", components=lambda: [Laser("front"), Laser("rear"), Mapper()], goal="(mapped)",
                  domain=PlanningDomain.parse("(define (domain d) (:predicates (mapped)))"))
"""
PROFILE = "profile: rear\nwiring: {mapper.scan: rear.scan}\n"
MODEL = """
deployment: lab
robot: lasers.py:bundle
profile: rear.yaml
platforms: {pc: {resources: {memory: 1000}}}
hosts: {base: {platform: pc}}
devices: {one: {kind: laser, host: base}, two: {kind: laser, host: base}}
groups: {sight: {host: base, components: [front, rear, mapper]}}
components: {rear: {tasks: {scan: {period: 0.04, worst_case: 0.01}}}}
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "lasers.py").write_text(ROBOT)
    (tmp_path / "rear.yaml").write_text(PROFILE)
    (tmp_path / "lab.yaml").write_text(MODEL)
    return tmp_path


def invoke(*words):
    return CliRunner().invoke(app, ["deployment", *map(str, words)])


def with_model(folder, old, new):
    assert old in MODEL
    (folder / "lab.yaml").write_text(MODEL.replace(old, new))


def test_the_demands_of_classes_and_of_the_model_are_checked_together(folder):
    result = invoke("check", folder / "lab.yaml")
    assert result.exit_code == 0, result.output
    assert "base, core 0, fixed priority: utilisation 41.0%, bound 82.8%" in result.output
    rear, front = [line.split() for line in result.output.splitlines() if ".scan" in line]
    assert (rear[0], rear[-2], front[0], front[-2]) == ("rear.scan", "10", "front.scan", "18")
    assert "no mistakes found" in result.output


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (", two: {kind: laser, host: base}", "", "needs 'laser', but 'rear' uses 'one'; add a device"),
        ("memory: 1000", "memory: 700", "has 700 of 'memory', but its components use 800 (mapper 800)"),
        ("[front, rear, mapper]", "[front, rear]", "component 'mapper' of the robot has no host"),
        ("components: {", "components: {sonar: {host: base}, ", "the robot has no component 'sonar'"),
        ("profile: rear.yaml\n", "", "several services fit port 'mapper.scan': front.scan, rear.scan"),
        ("worst_case: 0.01", "worst_case: 0.036", "the tasks on core 0 of host 'base' need 106% of its time"),
        ("worst_case: 0.01", "worst_case: 0.05", "the worst case of 0.05 s is longer than the period of 0.04 s"),
        (
            "components: {",
            "components: {mapper: {modes: {maping: {}}}, ",
            "has no mode 'maping'; did you mean 'mapping'?",
        ),
        (
            "components: {",
            "modes: {drive: {mapper: mapping}}\ncomponents: {",
            "'mapper' needs 'rear', which is not active",
        ),
        ("lasers.py:bundle", "lazers.py:bundle", "lab.yaml:3:1: there is no such file"),
        ("rear.yaml", "reer.yaml", "reer.yaml'; did you mean 'rear.yaml'?"),
    ],
)
def test_a_robot_that_does_not_fit_is_reported(folder, old: str, new: str, said: str):
    with_model(folder, old, new)
    result = invoke("check", folder / "lab.yaml")
    assert result.exit_code == 2
    assert said in result.output
    (found, *_) = json.loads(invoke("check", folder / "lab.yaml", "--json").output)
    assert found["code"].startswith(("deployment-", "wiring", "readable"))
    assert found["line"] or found["code"] == "wiring"


def test_a_simulation_never_exceeds_the_worst_response(folder):
    result = invoke("simulate", folder / "lab.yaml", "--seconds", 60, "--json")
    assert result.exit_code == 0
    rows = json.loads(result.output)
    assert [row["task"] for row in rows] == ["rear.scan", "front.scan"]
    for row in rows:
        assert row["missed"] == 0
        assert 0 < row["response"] <= row["worst_response"] <= row["deadline"]
    text = invoke("simulate", folder / "lab.yaml", "--seconds", 60).output
    assert "1500 jobs, 0 missed; response 10 ms, at worst 10 ms" in text
    with_model(folder, "worst_case: 0.01", "worst_case: 0.036")
    assert invoke("simulate", folder / "lab.yaml").exit_code == 2


def test_drawings_are_written(folder):
    assert invoke("draw", folder / "lab.yaml", "--svg", folder / "out.svg").exit_code == 0
    assert 'class="wire"' in (folder / "out.svg").read_text()
    assert "worst cases of lab" in invoke("draw", folder / "lab.yaml", "--timeline").output


def test_a_model_without_a_robot_needs_no_classes(folder):
    plain = MODEL.replace("robot: lasers.py:bundle\nprofile: rear.yaml\n", "").replace(
        "[front, rear, mapper]", "[rear]"
    )
    (folder / "plain.yaml").write_text(plain)
    assert invoke("check", folder / "plain.yaml").exit_code == 0


def test_a_mode_of_a_component_needs_no_demands(folder):
    with_model(folder, "components: {", "modes: {idle: {mapper: parked}, back: {rear: neutral}}\ncomponents: {")
    assert invoke("check", folder / "lab.yaml").exit_code == 0


def test_a_task_on_a_missing_core_is_never_simulated_or_drawn(folder):
    with_model(folder, "worst_case: 0.01}", "worst_case: 0.01, core: 2}")
    for words in (["simulate", folder / "lab.yaml"], ["draw", folder / "lab.yaml", "--timeline"]):
        assert "host 'base' has no core 2" in str(invoke(*words).exception)


def test_a_check_of_the_project_includes_its_monitoring_profiles(folder):
    (folder / "robot.py").write_text("from lasers import bundle\n\nrobot = bundle()\n")
    (folder / "monitor.yaml").write_text("monitor: m\ncomponents: {front: {stream: {scan: change}}}\n")
    found = CliRunner().invoke(app, ["check", str(folder)])
    assert "monitor.yaml:2:22: unknown key 'stream'; did you mean 'streams'?" in found.output


def test_a_monitoring_profile_among_profiles_is_none_of_them(folder):
    profiles = folder / "profiles"
    profiles.mkdir()
    (profiles / "rear.yaml").write_text(PROFILE)
    (profiles / "monitor.yaml").write_text("monitor: m\ncomponents: {front: {diagnose: {life: change}}}\n")
    (folder / "lasers.py").write_text(ROBOT.replace("goal=", f"profiles=Path({str(profiles)!r}), goal="))
    (folder / "robot.py").write_text("from lasers import bundle\n\nrobot = bundle()\n")
    source = (folder / "lasers.py").read_text()
    (folder / "lasers.py").write_text("from pathlib import Path\n" + source)
    found = CliRunner().invoke(app, ["check", str(folder)]).output
    assert "several services fit port 'mapper.scan'" in found
    assert "monitor.yaml" not in found


def test_a_check_of_the_project_includes_its_deployment_models(folder):
    (folder / "robot.py").write_text("from lasers import bundle\n\nrobot = bundle()\n")
    whole = CliRunner().invoke(app, ["check", str(folder)])
    with_model(folder, "memory: 1000", "memory: 700")
    for target in (folder, folder / "lab.yaml"):
        found = CliRunner().invoke(app, ["check", str(target)])
        assert "but its components use 800" in found.output
        assert found.exit_code == 2
    assert "lab.yaml" not in whole.output


def test_components_of_other_programs_are_placed_too(folder):
    robot = ROBOT.replace('goal="(mapped)",', 'goal="(mapped)", remote=("arm",),')
    (folder / "lasers.py").write_text(robot)
    lacks = invoke("check", folder / "lab.yaml")
    assert "component 'arm' of the robot has no host" in lacks.output
    with_model(folder, "components: {", "components: {arm: {host: base}, ")
    assert invoke("check", folder / "lab.yaml").exit_code == 0
    assert invoke("draw", folder / "lab.yaml").exit_code == 0


STEPS = """
    period = 0.05

    async def step(self):
        pass

    scan = Push"""


def test_a_task_has_the_period_of_the_steps_of_its_component(folder):
    (folder / "lasers.py").write_text(ROBOT.replace("    scan = Push", STEPS))
    with_model(folder, "rear: {tasks: {scan: {period: 0.04,", "rear: {tasks: {step: {period: 0.04,")
    found = invoke("check", folder / "lab.yaml")
    assert "lab.yaml:9:" in found.output
    assert "task 'step' has a period of 0.04 s, but component 'rear' steps every 0.05 s" in found.output
