"""Command `dsc tree`: findings with their lines, pictures as text, JSON and XML."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dsc.trees import load_trees, parse_trees
from planning.cli.command import app

FILES = Path(__file__).parents[1] / "trees"
GROOT = FILES / "groot.xml"


def dsc(*words):
    return CliRunner().invoke(app, ["tree", *map(str, words)])


@pytest.fixture
def broken(tmp_path):
    file = tmp_path / "broken.xml"
    text = GROOT.read_text("utf-8")
    file.write_text(text.replace("num_attempts=", "num_attempt=").replace("<AlwaysFailure/>", "<Grsp/>"), "utf-8")
    return file


def test_a_file_without_mistakes_has_no_findings():
    result = dsc("check", GROOT)
    assert (result.exit_code, result.stdout) == (0, "1 file checked, no mistakes found\n")


def test_a_leaf_that_the_file_does_not_declare_is_a_warning():
    result = dsc("check", GROOT, FILES / "format_3.xml", "--strict")
    assert result.exit_code == 2
    assert "format_3.xml:23:" not in result.stdout
    assert "<Drive> is not declared in TreeNodesModel" in result.stdout
    assert "[declared-leaf, warning]" in result.stdout


def test_mistakes_have_their_lines(broken):
    result = dsc("check", broken, "--json")
    found = json.loads(result.stdout)
    assert result.exit_code == 2
    lines = [(one["line"], one["code"], one["nearest"]) for one in found]
    assert (10, "behaviour-tree", "num_attempts") in lines
    assert (24, "declared-leaf", "Grasp") in lines


def test_a_file_that_is_not_xml_is_a_finding(tmp_path):
    file = tmp_path / "not.xml"
    file.write_text("<root>", "utf-8")
    result = dsc("check", file)
    assert result.exit_code == 2
    assert "not.xml:1:7: not readable as XML" in result.stdout


def test_a_tree_is_shown_as_text():
    result = dsc("show", GROOT, "--tree", "Serve")
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert lines[:4] == [
        "Serve",
        "└── ReactiveSequence 'while charged'",
        "    ├── BatteryOk min='0.2'",
        "    └── Fallback",
    ]
    assert len(lines) == 1 + sum(1 for _ in load_trees(GROOT).trees["Serve"].root.walk())


def test_a_file_is_shown_as_json_and_as_xml():
    trees = json.loads(dsc("show", GROOT, "--json").stdout)
    assert [one["tree"] for one in trees] == ["Serve", "Fetch"]
    assert trees[0]["root"]["children"][0]["role"] == "condition"
    assert parse_trees(dsc("show", FILES / "format_3.xml", "--xml").stdout) == load_trees(FILES / "format_3.xml")


def test_all_kinds_without_a_counterpart_are_reported(tmp_path):
    file = tmp_path / "navigate.xml"
    file.write_text(
        """<root main_tree_to_execute="Main"><BehaviorTree ID="Main">
<RecoveryNode number_of_retries="6">
<DistanceController distance="0.5"><ComputePathToPose goal="{goal}" path="{path}"/></DistanceController>
<SpeedController>
<GoalUpdater input_goal="{goal}" output_goal="{goal}"><FollowPath path="{path}"/></GoalUpdater>
</SpeedController>
</RecoveryNode>
</BehaviorTree></root>""",
        "utf-8",
    )
    found = json.loads(dsc("check", file, "--json").stdout)
    lines = [(one["line"], one["found"]) for one in found]
    assert lines == [(3, "DistanceController"), (4, "SpeedController"), (5, "GoalUpdater")]
