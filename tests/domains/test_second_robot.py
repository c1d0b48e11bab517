"""The same plots on a second robot with other skills, by profile alone (S2.10)."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from domains.clean_up_table import deploy, world_of
from domains.clean_up_table.bringup import HOME, bundle
from domains.clean_up_table.scenario import Scenario
from dsc.text.profiles import load_profile, parse_profile
from knowledge_base import InputError
from planning.cli.command import app
from planning.execution.shipped_plots import shipped_plots

SHIPPED = {file.stem: load_profile(file) for file in sorted((HOME / "profiles").glob("*.yaml"))}


def run(planner, name, seed=0, faults=0.0, scenario=None):
    table = deploy(scenario, seed, faults, planner, profile=SHIPPED[name])
    return table, table.report()


def test_every_robot_has_a_profile_and_every_profile_a_robot():
    assert {profile.robot for profile in SHIPPED.values()} == set(bundle().robots)


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("seed", range(4))
def test_each_robot_clears_the_table_with_the_same_plots(planner, name, seed):
    table, report = run(planner, name, seed, 0.15)
    assert {plot.name: plot for plot in table.library if plot not in shipped_plots()} == {
        p.name: p for p in bundle().plots
    }
    assert report.problem is None
    assert report.goal_reached == (not report.left) == world_of(table).goal_reached
    assert {one.what for one in report.left} == world_of(table).touched()
    if not any(fault.permanent for fault in world_of(table).fired):
        assert report.goal_reached


def test_the_robots_are_different_ones(planner):
    scenario = Scenario.parse("table: {cups: 2}")
    (usual, first), (other, second), (_, third) = (
        run(planner, n, scenario=scenario) for n in ("on_wheels", "on_tracks", "hurried")
    )
    assert first.goal_reached and second.goal_reached and third.goal_reached  # noqa: PT018
    assert third.simulated_s < first.simulated_s < second.simulated_s
    kinds = [{type(component).__name__ for component in table.components} for table in (usual, other)]
    assert not kinds[0] & kinds[1] - {"Voice"}
    skills = [{s for c in table.components for s in c.skills()} for table in (usual, other)]
    assert skills[1] - skills[0] == {"vent"}


def test_the_usual_profile_changes_nothing(planner):
    scenario = Scenario.parse("table: {cups: 2, cans: 1}")
    table = deploy(scenario, 3, 0.2, planner)
    without = table.report()
    _, with_it = run(planner, "on_wheels", 3, 0.2, scenario)
    assert with_it.simulated_s == without.simulated_s


def test_the_second_arm_tries_again_itself(planner):
    """What the hand leaves to a rule, suction repeats on its own: fewer failures reach the plots."""
    failures = {name: sum(run(planner, name, seed, 0.3)[1].skill_failures.get("grasp_failed", 0) for seed in range(3))
                for name in ("on_wheels", "on_tracks")}  # fmt: skip
    assert failures["on_tracks"] <= failures["on_wheels"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("robot: on_trakcs", "the bundle 'clean-up-table' has no robot 'on_trakcs'; did you mean 'on_tracks'?"),
        ("robot: on_tracks", "'arm.vacuum' has no value"),
        (
            "robot: on_tracks\ncomponents: {arm: {vacuum: 30, lifts: 1}}",
            "needs (<= ?lifts (* 0.025 ?vacuum)), but lifts is 1, vacuum is 30",
        ),
        ("components: {base: {speed: 3}}", "'base.speed' is from 0.05 to 1.5; found 3"),
    ],
)
def test_a_profile_that_does_not_fit_runs_nothing(planner, text, said):
    with pytest.raises(InputError) as error:
        deploy(planner=planner, profile=parse_profile(f"profile: p\n{text}\n", "p.yaml"))
    assert said in str(error.value)


def test_the_command_takes_a_name_or_a_file(tmp_path):
    slow = tmp_path / "slow.yaml"
    slow.write_text("profile: slow\ncomponents: {base: {speed: 0.05}}\n")
    scenario = tmp_path / "one.yaml"
    scenario.write_text("table: {cups: 1}\n")
    took = []
    for profile in ("hurried", str(slow)):
        shown = CliRunner().invoke(
            app, ["run", "clean-up-table", "--scenario", str(scenario), "--json", "--profile", profile]
        )
        assert shown.exit_code == 0
        took.append(json.loads(shown.output)["simulated_s"])
    assert took[0] < took[1]
    assert "hurried" in str(CliRunner().invoke(app, ["run", "clean-up-table", "--profile", "huried"]).exception)
