from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from dsc.text.plot_files import parse_plot
from knowledge_base.errors import InputError
from planning.cli import plan_command
from planning.cli.command import app
from planning.cli.doctor import doctor_command
from planning.engines import registry
from planning.engines.registry import ENGINES
from planning.model.plan import EngineFailed, PlanFound

DSC = Path(sys.executable).with_name("dsc")

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
    app.command("doctor")(doctor_command)
    path = tmp_path / "problem.pddl"

    def invoke(*options, problem=PROBLEM, domains=(domain_file,)):
        path.write_text(problem)
        words = ["plan", *map(str, domains), str(path), *options]
        return CliRunner().invoke(app, words, catch_exceptions=False)

    return invoke


def test_the_steps_are_numbered(run):
    result = run()
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert len(lines) == 6
    assert lines[0] == "  1 (pick-up cup1 table)"
    assert lines[-2] == "  5 (throw-away cup2 sink)"
    assert lines[-1] in {"cost 5, engine fast-downward", "cost 5, engine pyperplan"}


def test_json_has_outcome_steps_engine_and_seconds(run):
    answer = json.loads(run("--json").stdout)
    assert answer["outcome"] == "plan"
    assert answer["steps"][-1] == "(throw-away cup2 sink)"
    assert answer["engine"] in {"fast-downward", "pyperplan"}
    assert answer["cost"] == 5
    assert answer["seconds"] >= 0


def test_one_engine_can_be_named(run):
    assert json.loads(run("--json", "--engine", "pyperplan").stdout)["engine"] == "pyperplan"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("pyperlan", "there is no engine 'pyperlan'; for this problem there are fast-downward, pyperplan"),
        ("pyperlan", "did you mean 'pyperplan'"),
    ],
)
def test_an_unknown_engine_names_those_that_could(run, name, said):
    with pytest.raises(InputError) as caught:
        run("--engine", name)
    assert said in str(caught.value)


COUNTED = """(define (domain count) (:functions (n))
  (:action more :precondition (< (n) 5) :effect (increase (n) 1)))"""
TO_THREE = "(define (problem three) (:domain count) (:init (= (n) 0)) (:goal (>= (n) 3)))"


def test_an_engine_that_cannot_do_the_problem_names_those_that_can(run, tmp_path):
    domain = tmp_path / "count.pddl"
    domain.write_text(COUNTED)
    with pytest.raises(InputError, match="'pyperplan' cannot do numeric; for this problem there are kairos, enhsp"):
        run("--engine", "pyperplan", problem=TO_THREE, domains=[domain])


def test_an_engine_that_is_not_installed_says_how_to_get_it(run, monkeypatch):
    monkeypatch.setattr("planning.engines.registry.Engine.version", None)
    with pytest.raises(InputError, match=r"not installed: pip install 'up-fast-downward>=1\.0'"):
        run("--engine", "fast-downward")


@pytest.mark.parametrize(
    ("engine", "said"),
    [("pyperlan", "no engine 'pyperlan'; did you mean 'pyperplan'"), ("aries", "not installed: pip install 'up-aries")],
)
def test_a_run_with_an_unknown_or_missing_engine_is_refused(monkeypatch, engine, said):
    monkeypatch.setattr("planning.engines.registry.Engine.version", None)
    result = CliRunner().invoke(app, ["run", "clean-up-table", "--engine", engine])
    assert isinstance(result.exception, InputError)
    assert said in str(result.exception)


def test_without_any_engine_the_command_says_what_could_be_installed(run, monkeypatch):
    monkeypatch.setattr("planning.engines.registry.Engine.version", None)
    result = run()
    assert result.exit_code == 4
    assert "fast-downward could (pip install 'up-fast-downward>=1.0')" in result.stderr


def test_a_domain_may_come_in_fragments(run, tmp_path, domain_file):
    more = tmp_path / "more.pddl"
    more.write_text("(define (domain more) (:action wait :parameters () :effect (and)))")
    assert run(domains=[domain_file, more]).exit_code == 0


def test_a_problem_alone_is_not_enough(run):
    with pytest.raises(InputError, match="takes a domain and a problem"):
        run(domains=())


def test_each_step_says_what_it_is_for(run):
    lines = run("--explain").stdout.splitlines()
    assert lines[0] == "  1 (pick-up cup1 table)"
    assert lines[1].split() == ["(holding", "cup1)", "for", "step", "2"]
    assert lines[-2].split() == ["(tidy", "cup2)", "for", "the", "goal"]


TWO_LIGHTS = """(define (problem two) (:domain lights) (:objects a b - lamp) (:init (off a) (off b))
  (:goal (and (on a) (on b))))"""


def test_steps_that_need_not_wait_for_each_other_stand_in_lanes(run, tmp_path):
    domain = tmp_path / "lights.pddl"
    domain.write_text("""(define (domain lights) (:types lamp) (:predicates (on ?l - lamp) (off ?l - lamp))
      (:action switch :parameters (?l - lamp) :precondition (off ?l) :effect (and (on ?l) (not (off ?l)))))""")
    shown = run("--parallel", problem=TWO_LIGHTS, domains=[domain]).stdout.splitlines()
    assert [line for line in shown if "lane" in line] == ["lane 1", "lane 2"]
    answer = json.loads(run("--parallel", "--json", problem=TWO_LIGHTS, domains=[domain]).stdout)
    assert answer["lanes"] == [[1], [2]]
    assert answer["waits_for"] == {"1": [], "2": []}


def test_the_plan_can_be_written_as_a_plot(run, tmp_path):
    file = tmp_path / "plan.yaml"
    assert run("--plot", str(file)).exit_code == 0
    plot = parse_plot(file.read_text())
    assert [state.about for name, state in plot.states.items() if name.startswith("step")][:2] == [
        "(pick-up cup1 table)",
        "(stack cup1 cup2 one none table)",
    ]


def test_a_place_where_no_plot_can_be_written_is_refused_before_any_search(run, tmp_path, monkeypatch):
    monkeypatch.setattr("planning.cli.solving.PlannerRace", None)
    with pytest.raises(InputError, match=r"--plot: cannot write .*there is no folder '.*nowhere'"):
        run("--plot", str(tmp_path / "nowhere" / "plan.yaml"))
    with pytest.raises(InputError, match=r"--plot: cannot write .*it is a folder"):
        run("--plot", str(tmp_path))


def test_without_a_plan_no_plot_is_written(run, tmp_path):
    assert run("--plot", str(tmp_path / "plan.yaml"), "--seconds", "0").exit_code == 3
    assert not (tmp_path / "plan.yaml").exists()


def test_the_doctor_lists_every_engine_with_what_it_can_do_and_what_it_lacks(monkeypatch):
    app = typer.Typer()
    app.command()(doctor_command)
    found = json.loads(CliRunner().invoke(app, ["--json"], catch_exceptions=False).stdout)
    assert [one["name"] for one in found["engines"]] == [one.name for one in ENGINES]
    assert found["packages"]["unified-planning"]
    assert found["extras"]["viewer"]["ready"]
    assert next(one for one in found["engines"] if one["name"] == "pyperplan")["ready"]
    monkeypatch.setattr("shutil.which", lambda _: None)
    shown = CliRunner().invoke(app, [], catch_exceptions=False)
    assert shown.exit_code == 0
    assert all(one.name in shown.stdout for one in ENGINES)
    assert "put 'java' on the path" in shown.stdout
    assert "Java (none)" in shown.stdout
    assert "conditional effects and derived predicates are compiled away" in " ".join(shown.stdout.split())


def test_the_doctor_fits_a_terminal_of_100_columns(monkeypatch):
    monkeypatch.setattr("planning.cli.doctor.PIPE_WIDTH", 100)
    app = typer.Typer()
    app.command()(doctor_command)
    lines = CliRunner().invoke(app, [], catch_exceptions=False).stdout.splitlines()
    assert max(map(len, lines)) <= 100
    for one in ENGINES:
        assert any(one.name in line and one.licence in line for line in lines), one.name


def test_the_doctor_says_what_a_missing_part_is_for_and_how_to_install_it(monkeypatch):
    monkeypatch.setattr("planning.engines.registry.package_version", lambda name: None if "starl" in name else "1.0")
    found = json.loads(CliRunner().invoke(app, ["doctor", "--json"]).stdout)["extras"]
    assert (found["viewer"]["ready"], found["viewer"]["to_do"]) == (False, "pip install 'starlette>=0.40'")
    assert found["bt"] == {"about": "behaviour trees of py_trees as skills", "ready": True, "to_do": ""}


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
        async def plans(self, problem, seconds):
            yield EngineFailed("pyperplan", "it fell over")

        async def close(self):
            pass

    monkeypatch.setattr("planning.cli.solving.PlannerRace", Broken)
    result = run()
    assert result.exit_code == 4
    assert "it fell over" in result.stderr


TOLLS = """(define (domain tolls) (:types place) (:predicates (at ?p - place) (road ?a ?b - place))
  (:functions (total-cost) (toll ?a ?b - place))
  (:action drive :parameters (?a ?b - place) :precondition (and (at ?a) (road ?a ?b))
    :effect (and (not (at ?a)) (at ?b) (increase (total-cost) (toll ?a ?b)))))"""
ROUND = """(define (problem round) (:domain tolls) (:objects a b c - place)
  (:init (at a) (road a c) (road a b) (road b c) (= (toll a c) 10) (= (toll a b) 3) (= (toll b c) 3)) (:goal (at c))
  )"""


class Anytime:
    """Finds the direct way at once, then the one round the corner, and then goes on searching until it is stopped."""

    stopped = False

    async def plans(self, problem, seconds):
        named = {str(action.step): number for number, action in enumerate(problem.actions)}
        ways = (["(drive a c)"], ["(drive a b)", "(drive b c)"])
        try:
            for way in ways:
                numbers = [named[step] for step in way]
                yield PlanFound(problem.plan(numbers), "anytime", 0.0, 0.0, cost=problem.cost(numbers))
            await asyncio.get_running_loop().create_future()
        finally:
            Anytime.stopped = True

    async def close(self):
        pass


@pytest.mark.parametrize(
    ("function", "steps", "cost"),
    [("total-cost", 2, "cost 6, engine anytime"), ("driven", 1, "cost 1, engine anytime")],
)
def test_a_cheaper_plan_is_awaited_if_actions_have_costs(run, tmp_path, monkeypatch, function, steps, cost):
    monkeypatch.setattr("planning.cli.solving.PlannerRace", Anytime)
    monkeypatch.setattr("planning.cli.solving.PATIENT_SECONDS", 0.05)
    monkeypatch.setattr(Anytime, "stopped", False)
    (tmp_path / "tolls.pddl").write_text(TOLLS.replace("total-cost", function))
    lines = run(problem=ROUND, domains=[tmp_path / "tolls.pddl"]).stdout.splitlines()
    assert (len(lines) - 1, lines[-1]) == (steps, cost)
    assert Anytime.stopped


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


JARS = """(define (domain jars) (:requirements :no-such-thing) (:types jar)
  (:predicates (sealed ?j - jar)) (:functions (litres ?j - jar) (price ?j - jar))
  (:action fill :parameters (?j - jar) :effect (and (increase (litres ?j) 1) (assign (price ?j) (litres ?j))))
  (:action seal :parameters (?j - jar) :precondition (> (litres ?j) 1) :effect (sealed ?j)))
"""
SEAL = "(define (problem p) (:domain jars) (:objects a - jar) (:goal (sealed a)) (:metric minimize (price a)))"


def test_an_unsupported_condition_is_named_with_the_engines_that_support_it(run, tmp_path, monkeypatch):
    monkeypatch.setattr(registry.Engine, "lacks", lambda one: "pip install x" if "numeric" in one.features else "")
    (tmp_path / "jars.pddl").write_text(JARS)
    result = run(problem=SEAL, domains=[tmp_path / "jars.pddl"])
    assert result.exit_code == 4
    assert "jars.pddl:4:" in result.stderr
    assert (
        "(> (litres ?j) 1); no installed engine can do that, kairos could (pip install x), enhsp could (pip install x)"
        in result.stderr
    )


def test_notes_about_files_and_the_problem_are_printed(run, tmp_path, monkeypatch):
    monkeypatch.setattr(registry.Engine, "lacks", lambda one: "pip install x" if "numeric" in one.features else "")
    (tmp_path / "jars.pddl").write_text(JARS)
    said = run(problem=SEAL, domains=[tmp_path / "jars.pddl"])
    [about_file, about_metric, _] = said.stderr.splitlines()
    assert about_file.startswith("note: ")
    assert ":no-such-thing" in about_file
    assert about_metric.startswith("note: the metric (price a) is ignored")
    answer = json.loads(run("--json", problem=SEAL, domains=[tmp_path / "jars.pddl"]).stdout)
    assert [f"note: {one}" for one in answer["notes"]] == [about_file, about_metric]
    assert answer["outcome"] == "no_engine"


ANY = """(define (domain any) (:predicates (g)) (:action a :parameters (?a ?b ?c ?d ?e ?f ?h ?i) :effect (g)))"""


def test_the_time_is_for_posing_as_well(run, tmp_path):
    domain = tmp_path / "any.pddl"
    domain.write_text(ANY)
    things = " ".join(f"o{i}" for i in range(40))
    problem = f"(define (problem p) (:domain any) (:objects {things}) (:init) (:goal (g)))"
    result = run("--seconds", "0.05", problem=problem, domains=[domain])
    assert result.exit_code == 3
    assert result.stderr == "no plan within 0.05 s (while grounding action 'a')\n"
    answer = json.loads(run("--json", "--seconds", "0.05", problem=problem, domains=[domain]).stdout)
    assert (answer["outcome"], answer["while"]) == ("timed_out", "grounding action 'a'")


ERRAND = """(define (domain errand) (:types place) (:predicates (at ?p - place) (near ?p - place))
  (:functions (toll ?p - place) (left) (total-cost))
  (:derived (near ?p - place) (at ?p))
  (:action go :parameters (?p - place) :precondition (<= (left) 3)
    :effect (and (at ?p) (increase (total-cost) (toll ?p)))))"""


@pytest.mark.parametrize(
    ("init", "notes"),
    [
        ("(= (left) 0) (= (toll a) 2)", []),
        ("(= (left) 0)", ["(toll a) has no value and counts as 0"]),
        ("", ["(left) has no value and counts as 0", "(toll a) has no value and counts as 0"]),
        (
            "(= (left) 0) (= (toll a) 2) (near a)",
            ["problem.pddl: facts of 'near' in :init are ignored, since it is derived"],
        ),
    ],
)
def test_numbers_without_a_value_and_facts_that_only_follow_from_others_are_noted(run, tmp_path, init, notes):
    (tmp_path / "errand.pddl").write_text(ERRAND)
    problem = f"(define (problem p) (:domain errand) (:objects a - place) (:init {init}) (:goal (near a)))"
    answer = json.loads(
        run("--json", "--engine", "pyperplan", problem=problem, domains=[tmp_path / "errand.pddl"]).stdout
    )
    assert answer["steps"] == ["(go a)"]
    assert [one.replace(f"{tmp_path}/", "") for one in answer["notes"]] == notes


TOWERS = """(define (domain towers) (:types block)
  (:predicates (on ?a ?b - block) (above ?a ?b - block) (clear ?a - block))
  (:derived (above ?a ?b - block) (or (on ?a ?b) (exists (?c - block) (and (on ?a ?c) (above ?c ?b)))))
  (:action stack :parameters (?a ?b - block) :precondition (and (clear ?a) (clear ?b) (not (= ?a ?b)))
    :effect (and (on ?a ?b) (not (clear ?b)))))"""


@pytest.mark.parametrize(
    ("goal", "status", "said"),
    [
        ("(and (above a c) (not (on a c)))", 0, "cost 2"),
        ("(and (above a c) (above c a))", 1, "there is no plan"),
        ("(above a a)", 1, "there is no plan"),
    ],
)
def test_a_predicate_that_follows_from_itself_and_from_what_actions_change_is_planned_with(
    run, tmp_path, goal, status, said
):
    (tmp_path / "towers.pddl").write_text(TOWERS)
    problem = f"(define (problem p) (:domain towers) (:objects a b c - block) (:init (clear a) (clear b) (clear c)) (:goal {goal}))"
    result = run("--engine", "pyperplan", "--explain", problem=problem, domains=[tmp_path / "towers.pddl"])
    assert result.exit_code == status
    assert said in result.output
    assert ("'above': planning actions change what it follows from" in result.stderr) == (status == 0)
    assert "derive" not in result.stdout


def test_a_shell_completes_commands_and_robots():
    def completed(words):
        environment = {**os.environ, "_DSC_COMPLETE": "complete_bash", "COMP_WORDS": words}
        environment["COMP_CWORD"] = str(words.count(" "))
        done = subprocess.run([DSC], env=environment, capture_output=True, text=True, check=True)
        return done.stdout.split()

    assert completed("dsc plo") == ["plot"]
    assert completed("dsc run clean") == ["clean-up-table"]
