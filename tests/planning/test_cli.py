from __future__ import annotations

import json
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from knowledge_base.errors import InputError
from planning.cli import plan_command
from planning.plan import EngineFailed

PROBLEM = """(define (problem two-cups) (:domain clean-up-table)
  (:objects table - surface  sink - destination  cup1 cup2 - cup)
  (:init (robot-at table) (hand-free) (one-less one none) (passable table) (passable sink)
         (lies-at cup1 table) (lies-at cup2 table) (graspable cup1) (graspable cup2) (fits cup1 cup2)
         (goes-to cup1 sink) (goes-to cup2 sink) (free-room cup1 one) (free-room cup2 one))
  (:goal (forall (?i - item) (tidy ?i))))
"""


@pytest.fixture
def run(domain_file, tmp_path):
    app = typer.Typer()
    app.command("plan")(plan_command)
    path = tmp_path / "problem.pddl"

    def invoke(*options, problem=PROBLEM):
        path.write_text(problem)
        return CliRunner().invoke(app, [str(domain_file), str(path), *options], catch_exceptions=False)

    return invoke


def test_the_steps_are_numbered(run):
    result = run()
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert len(lines) == 5
    assert lines[0] == "  1 (pick-up cup1 table)"
    assert lines[-1] == "  5 (throw-away cup2 sink)"


def test_json_has_outcome_steps_engine_and_seconds(run):
    answer = json.loads(run("--json").stdout)
    assert answer["outcome"] == "plan"
    assert answer["steps"][-1] == "(throw-away cup2 sink)"
    assert answer["engine"] == "pyperplan"
    assert answer["seconds"] >= 0


def test_nothing_to_do_is_a_plan(run):
    result = run(problem=PROBLEM.replace("(forall (?i - item) (tidy ?i))", "(hand-free)"))
    assert result.exit_code == 0
    assert "already holds" in result.stdout


def test_an_unsolvable_problem_is_explained_on_request(run):
    problem = PROBLEM.replace("(graspable cup1)", "")
    result = run("--explain", problem=problem)
    assert result.exit_code == 1
    assert result.stdout == ""
    assert "(graspable cup1) does not hold" in result.stderr
    answer = json.loads(run("--json", problem=problem).stdout)
    assert answer["outcome"] == "unsolvable"
    assert answer["steps"] == []
    assert "why" not in answer


def test_no_time_is_out_of_time(run):
    result = run("--json", "--seconds", "0")
    assert result.exit_code == 3
    assert json.loads(result.stdout)["outcome"] == "timed_out"


def test_a_failed_engine_has_a_status_of_its_own(run, monkeypatch):
    class Broken:
        async def solve(self, problem, seconds):
            return EngineFailed("pyperplan", "it fell over")

        async def close(self):
            pass

    monkeypatch.setattr("planning.planner.PlannerProcess", Broken)
    result = run()
    assert result.exit_code == 4
    assert "it fell over" in result.stderr


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("(tidy ?i)", "(tidi ?i)", "did you mean 'tidy'"),
        ("(hand-free)", "(hand-fre)", "did you mean 'hand-free'"),
        ("- cup)", "- cop)", "did you mean 'cup'"),
        ("(lies-at cup1 table)", "(lies-at cup1 tabel)", "did you mean 'table'"),
        ("(:domain clean-up-table)\n  (:objects", "(:domain ferry)\n  (:objects c - car", "for the domain 'ferry'"),
        ("(:goal (forall (?i - item) (tidy ?i)))", "", "has no goal"),
    ],
)
def test_bad_input_names_file_and_what_was_meant(run, old, new, said):
    with pytest.raises(InputError, match="problem") as caught:
        run(problem=PROBLEM.replace(old, new))
    assert said in str(caught.value)
    assert caught.value.place.source.endswith("problem.pddl")


def test_the_command_line_loads_no_planner():
    heavy = "('unified_planning', 'networkx', 'pydantic')"
    script = f"import planning.cli, sys; print([m for m in {heavy} if m in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"
