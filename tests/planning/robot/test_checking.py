"""`dsc check`: every mistake of a project is found at once, and a mistake hides no other."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from planning.engines.registry import Engine
from planning.robot.checking import check_project

ROOT = Path(__file__).parents[3]
PROJECT = ROOT / "tests" / "support" / "delivery_project"
DSC = Path(sys.executable).with_name("dsc")

PLANTED = [
    ("domain.pddl", "(in ?parcel ?at))\n    :effect", "(inn ?parcel ?at))\n    :effect", "no predicate 'inn'; did you mean 'in'"),
    ("domain.pddl", "(robot-in ?at) (holding", "(robot-in ?att) (holding", "'?att' is not bound"),
    ("domain.pddl", "(not (holding ?parcel))", "(not (holds ?parcel))", "no predicate 'holds'; did you mean 'holding'"),
    ("domain.pddl", "?from ?to - room", "?from ?to - rom", "no type 'rom'; did you mean 'room'"),
    ("plots/drive.yaml", "wheels.drive", "weels.drive", "no component offers the skill or event 'weels.drive'; did you mean"),
    ("plots/drive.yaml", "stuck: {final: true}", "stuck: {final: true, emit: blokked}", "'blokked'; did you mean 'blocked'"),
    ("plots/put.yaml", "parcel: ?parcel", "parcel: ?parsel", "no variable '?parsel' here; did you mean 'parcel'"),
    ("plots/put.yaml", "implements: put", "implements: putt", "no planning action 'putt'; did you mean 'put'"),
    ("plots/put.yaml", "put: there", "put: their", "their"),
    ("plots/take.yaml", "taken: there", "takn: there", "'takn'; did you mean 'taken'"),
    ("plots/take.yaml", "{parcel: parcel}", "{parcel: parsel}", "parsel"),
    ("plots/deliver_all.yaml", "gave_up: failed", "gave_upp: failed", "does not handle its outcome 'gave_up'"),
    ("plots/deliver_all.yaml", "on: blocked", "on: bloked", "can end with 'bloked'; did you mean 'blocked'"),
    ("plots/deliver_all.yaml", "(exists (?r - room)", "(exists (?r - roomm)", "roomm"),
    ("profiles/fast.yaml", "speed: 5", "sped: 5", "no parameter 'sped'; did you mean 'speed'"),
    ("delivery.py", '"wheels"\n', '"wheels"\n    modes = ("fast",)\n    needs = {"fst": ("gripper",)}\n', "'fst'"),
    ("delivery.py", "to: Room)", "to: Rom)", "the annotation of 'to' names 'Rom', which does not exist when the class is made; did you mean 'Room'"),
    ("delivery.py", "async def put(", "def put(", "skill 'Gripper.put' is not a coroutine"),
    ("delivery.py", "def grasp(self, call: SkillCall, parcel", "def grasp(self, parcel", "no parameter for its call"),
    ("delivery.py", 'main="deliver_all"', 'main="deliver_al"', "no plot 'deliver_al'; did you mean 'deliver_all'"),
    ("delivery.py", "(in ?p ?r))))\",", "(on ?p ?r))))\",", "no predicate 'on'"),
    ("delivery.py", 'fact("robot-in", self.robot_at),\n', 'fact("robot-at", self.robot_at),\n', "no predicate 'robot-at'; did you mean 'robot-in'"),
    ("plots/deliver_all.yaml", "then: retry", "then: retri", "'retri'; did you mean 'retry'"),
    ("plots/drive.yaml", "{to: room}\nimpl", "{to: rooom}\nimpl", "no type 'rooom'; did you mean 'room'"),
    ("plots/take.yaml", "  there: {final: true}", "  there: {final: true}\n  rest: {final: true}", "'rest'"),
]  # fmt: skip

ALONE = [
    ("plots/deliver_all.yaml", "(forall (?p - parcel) (exists (?r - room) (and (goes-to ?p ?r) (in ?p ?r))))", "(robot-in ofice)", "no object 'ofice' of type room; did you mean 'office'"),
    ("plots/deliver_all.yaml", "done: home", "done: {to: home, when: (in parcel3 hall)}", "no object 'parcel3' of type parcel; did you mean"),
    ("plots/deliver_all.yaml", "done: home", "done: {to: home, tell: (robot-in parcel1)}", "'parcel1' is of type parcel, not of type room"),
    ("delivery.py", "@skill\n    async def put(", "async def put(", "put `@skill` above method 'put' of component 'gripper'"),
    ("plots/drive.yaml", "emits: {", "emits: {broken: {}, ", "the plot never emits its outcome 'broken'"),
    ("delivery.py", 'Annotated[str, "room"]', 'Annotated[str, "rom"]', "'to' of skill 'wheels.drive' is of the unknown type 'rom'; did you mean 'room'"),
    ("plots/deliver_all.yaml", "rules:\n  - on: blocked\n    do: {then: retry, limit: 2}", "handlers:\n  - on: blocked\n    do: {tell: (robot-in hall)}", "'blocked' is (answer it by a rule, under `rules`)"),
    ("plots/deliver_all.yaml", "rules:\n", "handlers:\n", "`then` belongs to a rule"),
    ("profiles/fast.yaml", "profile: fast", "profile: quick", "the profile is named 'quick', and its file 'fast'"),
    ("plots/drive.yaml", "implements: drive\n", "when: (robot-in hall)\n", "nothing chooses the plot 'drive'"),
    ("delivery.py", "-> Arrived | Blocked:", "-> Arrived:", "nothing here fires the event 'blocked'"),
]  # fmt: skip
"""Mistakes that others of `PLANTED` would hide."""


@pytest.fixture
def project(tmp_path, monkeypatch):
    home = tmp_path / "house"
    shutil.copytree(PROJECT, home)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield home
    sys.modules.pop("delivery", None)


def planted(home, mistakes):
    for file, right, wrong, _ in mistakes:
        text = (home / file).read_text()
        assert right in text, (file, right)
        (home / file).write_text(text.replace(right, wrong, 1))


def test_a_project_without_mistakes_has_no_findings(project):
    assert check_project(str(project)) == []


@pytest.mark.parametrize("number", range(len(PLANTED) + len(ALONE)))
def test_each_mistake_is_found_with_its_file(project, number):
    mistake = [*PLANTED, *ALONE][number]
    planted(project, [mistake])
    file, _, _, said = mistake
    found = [one for one in check_project(str(project)) if said in str(one)]
    assert found
    if file != "delivery.py":
        assert str(found[0]).startswith(str(project / file))
        assert found[0].place is not None
        assert found[0].place.line


def test_all_mistakes_are_found_at_once(project):
    planted(project, PLANTED)
    (project / "plots" / "broken.yaml").write_text("plot: broken\nstates: [\n")
    (project / "plots" / "other.yaml").write_text(
        "plot: other\nstates:\n  a: {use: broken, on: {done: e}}\n  e: {final: true}\n"
    )
    (project / "unused.py").write_text("def f(:\n")
    report = "\n".join(map(str, check_project(str(project))))
    missing = [said for *_, said in PLANTED if said not in report]
    assert missing == []
    assert "broken.yaml:3:1" in report
    assert "unused.py:1" in report
    assert "no plot 'broken'" not in report  # its file has the mistake


def test_a_simulation_with_a_bug_is_a_finding_with_its_line(project):
    planted(project, [("delivery.py", "[Wheels(self), Gripper(self)]", "[Wheels(self), Griper(self)]", "")])
    (found,) = check_project(str(project))
    assert "NameError: name 'Griper' is not defined" in str(found)
    assert "delivery.py:" in str(found)


def test_files_without_a_robot_are_checked_too(project):
    for name in ("pyproject.toml", "delivery.py"):
        (project / name).unlink()
    planted(project, [PLANTED[0], PLANTED[6]])
    found = check_project(str(project))
    assert [PLANTED[0][3] in str(found[0]), PLANTED[6][3] in str(found[1])] == [True, True]
    assert len(found) == 2


def test_a_plot_file_is_a_project_too(project):
    planted(project, [PLANTED[6]])
    (found,) = check_project(str(project / "plots" / "put.yaml"))
    assert PLANTED[6][3] in str(found)


def test_the_command_prints_the_list_and_has_a_status(project):
    good = subprocess.run([DSC, "check", project], capture_output=True, text=True, check=False)
    assert (good.returncode, good.stderr) == (0, "")
    assert "no mistakes found" in good.stdout
    planted(project, [PLANTED[0], PLANTED[16]])
    bad = subprocess.run([DSC, "check"], cwd=project, capture_output=True, text=True, check=False)
    assert (bad.returncode, bad.stderr) == (2, "")
    lines = bad.stdout.splitlines()
    assert [line.split(":")[0] for line in lines] == ["delivery.py", "domain.pddl"]
    as_json = subprocess.run([DSC, "check", project, "--json"], capture_output=True, text=True, check=False)
    assert [one["found"] for one in json.loads(as_json.stdout)] == ["Rom", "inn"]


@pytest.mark.parametrize("target", ["clean-up-table", "examples/own_domain.py", "tests/support/lasting_robot"])
def test_our_own_robots_have_no_findings(target, monkeypatch):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "path", [*sys.path])
    assert check_project(target) == []


def test_a_programming_error_is_one_line_of_the_list(project):
    planted(project, [("delivery.py", "[Wheels(self), Gripper(self)]", "[Wheels(self), Griper(self)]", "")])
    done = subprocess.run([DSC, "check", project], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "")
    assert len(done.stdout.splitlines()) == 1


@pytest.mark.parametrize("has_engine", [True, False])
def test_numbers_that_no_installed_engine_can_plan_with_are_a_warning_with_the_remedy(project, monkeypatch, has_engine):
    lacks = "" if has_engine else "pip install 'up-enhsp>=0.1.1'"
    monkeypatch.setattr(Engine, "lacks", lambda one: lacks if one.name in {"enhsp", "kairos"} else "")
    planted(project, [
        ("domain.pddl", "(full))\n", "(full)) (:functions (charge))\n", ""),
        ("domain.pddl", ":precondition (robot-in ?from)", ":precondition (and (robot-in ?from) (>= (charge) 0))", ""),
        ("domain.pddl", "(robot-in ?to))", "(robot-in ?to) (decrease (charge) 1))", ""),
    ])  # fmt: skip
    found = [str(one) for one in check_project(str(project)) if one.code == "engine"]
    assert len(found) == (not has_engine)
    if found:
        assert found[0].startswith(f"{project / 'domain.pddl'}:7:")
        assert found[0].endswith("enhsp could (pip install 'up-enhsp>=0.1.1') [warning]")


def test_a_first_goal_that_holds_already_is_a_warning(project):
    planted(project, [("delivery.py", '*(fact("goes-to", parcel', '*(fact("in", parcel', "")])
    planted(project, [("plots/deliver_all.yaml", "(exists (?r - room) (and (goes-to ?p ?r) (in ?p ?r)))", "(exists (?r - room) (in ?p ?r))", "")])  # fmt: skip
    (found,) = check_project(str(project))
    assert "the goal holds in the initial knowledge, so nothing is planned" in str(found)
    assert (found.level, found.place is not None) == ("warning", True)


def test_a_first_goal_that_cannot_be_reached_is_a_warning_with_the_reason(project):
    planted(
        project, [("domain.pddl", ":precondition (robot-in ?from)", ":precondition (and (robot-in ?from) (full))", "")]
    )
    (found,) = [one for one in check_project(str(project)) if one.code == "goal"]
    assert found.level == "warning"
    assert str(found).startswith(f"{project / 'plots' / 'deliver_all.yaml'}:")
    assert "the goal cannot be reached from the initial knowledge" in str(found)
    assert "(full) does not hold, and no planning action makes it true" in str(found)


def test_a_goal_whose_parts_exclude_each_other_is_a_warning(project):
    goal = "(forall (?p - parcel) (exists (?r - room) (and (goes-to ?p ?r) (in ?p ?r))))"
    planted(project, [("plots/deliver_all.yaml", goal, "(and (robot-in office) (robot-in kitchen))", "")])
    (found,) = check_project(str(project))
    assert "(robot-in office) and (robot-in kitchen) can never hold together" in str(found)


@pytest.mark.parametrize(("room", "fits"), [("office", False), ("hall", True)])
def test_the_goal_beside_candidates_is_the_first_one_if_none_fits_at_the_start(project, room, fits):
    goal = "(forall (?p - parcel) (exists (?r - room) (and (goes-to ?p ?r) (in ?p ?r))))"
    wrong = [
        ("plots/deliver_all.yaml", goal, "(and (robot-in office) (robot-in kitchen))", ""),
        ("plots/deliver_all.yaml", "dynamic: []", f"dynamic: [drive]\n    with: {{to: {room}}}", ""),
        ("plots/deliver_all.yaml", "gave_up: failed", "gave_up: failed, blocked: failed", ""),
        ("plots/drive.yaml", "parameters:", "when: (robot-in ?to)\nparameters:", ""),
    ]
    planted(project, wrong)
    found = "\n".join(map(str, check_project(str(project))))
    assert ("can never hold together" in found) is not fits


def test_an_object_of_a_problem_file_is_known(project):
    planted(project, [("plots/deliver_all.yaml", "done: home", "done: {to: home, when: (robot-in attic)}", "")])
    assert "no object 'attic'" in str(check_project(str(project))[0])
    problem = "(define (problem more) (:domain delivery) (:objects attic - room) (:init) (:goal (robot-in attic)))"
    (project / "more.pddl").write_text(problem)
    assert check_project(str(project)) == []


PROFILES = [
    ("profile: bad\nrobot: on_traks\n", 2, "the bundle 'delivery' has no robot 'on_traks'; did you mean 'on_tracks'"),
    ("profile: bad\ncomponents: {wheels: {speed: 50}}\n", 2, "'wheels.speed' is from 0.1 to 5; found 50"),
    ("profile: bad\ncomponents: {weels: {speed: 5}}\n", 2, "no component 'weels'; did you mean 'wheels'"),
    ("profile: bad\nplots: {drve: {to: hall}}\n", 2, "no plot 'drve'; did you mean 'drive'"),
    ("profile: bad\nplots: {drive: {tu: hall}}\n", 2, "plot 'drive' has no parameter 'tu'"),
    ("profile: bad\ndevices: {drve: {left: a}}\n", 2, "no plot 'drve'; did you mean 'drive'"),
    ("profile: bad\ndevices: {drive: {left: a}}\n", 2, "plot 'drive' has no sensor or motor 'left'"),
]


@pytest.mark.parametrize("place", ["profiles/bad.yaml", "extra/bad.yaml", "bad.yaml"])
@pytest.mark.parametrize(("text", "line", "said"), PROFILES)
def test_a_profile_is_checked_with_its_robot_wherever_it_is(project, place, text, line, said):
    planted(project, [("delivery.py", "simulation=House,", 'simulation=House,\n    robots={"on_tracks": House},', "")])
    file = project / place
    file.parent.mkdir(exist_ok=True)
    file.write_text(text)
    (found,) = check_project(str(project))
    assert str(found).startswith(f"{file}:{line}:")
    assert said in str(found)
    assert [str(one) for one in check_project(str(file))] == [str(found)]


def test_the_robot_of_a_profile_is_one_of_the_bundle(project):
    (project / "profiles" / "bad.yaml").write_text("profile: bad\nrobot: on_traks\n")
    (found,) = check_project(str(project))
    assert "the bundle 'delivery' has no robots by name (Bundle.robots)" in str(found)
    planted(project, [("delivery.py", "simulation=House,", 'simulation=House,\n    robots={"on_tracks": Tracks},', "")])
    planted(project, [("delivery.py", "Room = ", "class Tracks(House):\n    def components(self):\n        return [Gripper(self)]\n\n\nRoom = ", "")])  # fmt: skip
    (project / "profiles" / "bad.yaml").write_text("profile: bad\nrobot: on_tracks\ncomponents: {wheels: {speed: 5}}\n")
    sys.modules.pop("delivery")
    (found,) = check_project(str(project))
    assert "there is no component 'wheels'" in str(found)  # that robot has none


def test_a_folder_of_projects_names_its_projects(project):
    shutil.copytree(project, project.parent / "other")
    (found,) = check_project(str(project.parent))
    assert f"`dsc check {project.parent / 'house'}`, `dsc check {project.parent / 'other'}`" in str(found)


@pytest.mark.parametrize(
    ("right", "wrong", "line", "said"),
    [
        (
            "(robot-in ?to)))\n",
            "(robot-in ?to))\n",
            None,
            "'(' of ':action' is never closed: ':action' begins inside it",
        ),
        ("(robot-in ?r - room)", "(robot-in ?r - room", None, "'(' of ':predicates' is never closed: ':action' begins"),
    ],
)
def test_a_parenthesis_without_its_partner_names_the_section(project, right, wrong, line, said):
    planted(project, [("domain.pddl", right, wrong, "")])
    assert said in "\n".join(map(str, check_project(str(project))))


def test_a_file_that_the_simulation_does_not_find_is_a_programming_error_with_its_line(project):
    planted(project, [("delivery.py", "self.robot_at = ", 'open("world.json")\n        self.robot_at = ', "")])
    (found,) = check_project(str(project))
    assert "programming error in House: FileNotFoundError" in str(found)
    assert "delivery.py:" in str(found)
    run = subprocess.run([DSC, "run", str(project)], capture_output=True, text=True, cwd=project, check=False)
    assert run.returncode == 3
    assert "programming error in House: FileNotFoundError" in run.stderr


def test_a_scene_that_raises_an_exception_is_a_programming_error_with_its_line(project):
    scene = "    def scene(self):\n        raise KeyError('x')\n\n    def left(self)"
    planted(project, [("delivery.py", "    def left(self)", scene, "")])
    run = subprocess.run([DSC, "run", str(project)], capture_output=True, text=True, cwd=project, check=False)
    assert run.returncode == 3
    assert "programming error in House.scene: KeyError: 'x' (" in run.stderr


@pytest.mark.parametrize(
    ("functions", "read", "said"),
    [
        ("(charge)", "(>= (charge) 0)", "no initial value of (charge), which counts as 0"),
        ("(size ?r - room)", "(>= (size ?to) 0)", "no initial value of (size …), which counts as 0"),
        ("(far ?a ?b - room)", "(>= (far ?from ?to) 0)", "no initial value of (far … …), which counts as 0"),
    ],
)
def test_a_number_without_an_initial_value_is_a_warning(project, functions, read, said):
    planted(project, [
        ("domain.pddl", "(full))\n", f"(full)) (:functions {functions})\n", ""),
        ("domain.pddl", ":precondition (robot-in ?from)", f":precondition (and (robot-in ?from) {read})", ""),
    ])  # fmt: skip
    (found,) = check_project(str(project))
    assert str(found).startswith(f"{project / 'domain.pddl'}:5:")
    assert said in str(found)
    assert found.level == "warning"


@pytest.mark.parametrize(
    ("file", "right", "wrong"),
    [
        ("plots/deliver_all.yaml", "done: home", "done: [{to: home, when: (full)}, failed]"),
        ("domain.pddl", "(and (robot-in ?at) (in", "(and (robot-in ?at) (full) (in"),
    ],
)
@pytest.mark.parametrize(
    ("source", "before", "makes"),
    [
        (None, "", ""),
        ("plots/drive.yaml", "arrived: there", "arrived: {to: there, tell: (full)}"),
        ("domain.pddl", "(robot-in ?to)))", "(robot-in ?to) (full)))"),
        ("delivery.py", "added=(", 'added=(fact("full"), '),
        ("domain.pddl", "  (:action drive", "  (:derived (full) (exists (?r - room) (robot-in ?r)))\n  (:action drive"),
    ],
)
def test_a_predicate_that_nothing_makes_true_is_a_warning(project, file, right, wrong, source, before, makes):
    planted(project, [(file, right, wrong, ""), *([(source, before, makes, "")] if source else [])])
    said = [str(one) for one in check_project(str(project)) if one.code == "made-true"]
    assert ["domain.pddl:5:" in one and "nothing makes (full) true, and " in one for one in said] == [True] * (
        source is None
    )


@pytest.mark.parametrize(
    ("condition", "effect", "said"),
    [
        ("(>= (chrge) 0)", "", "there is no function 'chrge'; did you mean 'charge'?"),
        ("(>= (charge) (size ?to))", "", "there is no function 'size'"),
        ("(>= (full) 1)", "", "there is no function 'full'"),
        ("", "(decrease (chrge) 1)", "there is no function 'chrge'; did you mean 'charge'?"),
        ("", "(decrease (charge) (robot-in ?to))", "there is no function 'robot-in'"),
    ],
)
def test_an_undeclared_function_of_an_action_is_found(project, condition, effect, said):
    planted(project, [
        ("domain.pddl", "(full))\n", "(full)) (:functions (charge))\n", ""),
        ("domain.pddl", ":precondition (robot-in ?from)", f":precondition (and (robot-in ?from) {condition})", ""),
        ("domain.pddl", "(not (robot-in ?from))", f"(not (robot-in ?from)) {effect}", ""),
    ])  # fmt: skip
    errors = [one for one in check_project(str(project)) if one.level == "error"]
    assert [said in str(one) for one in errors] == [True]
    assert str(errors[0]).startswith(f"{project / 'domain.pddl'}:")


def test_a_goal_beyond_the_limit_of_a_number_is_a_warning(project):
    planted(project, [
        ("domain.pddl", "(full))\n", "(full)) (:functions (charge))\n", ""),
        ("domain.pddl", ":precondition (robot-in ?from)", ":precondition (and (robot-in ?from) (>= (charge) 5))", ""),
        ("delivery.py", "            added=(\n", "            values={fact(\"charge\"): 2.0},\n            added=(\n", ""),
    ])  # fmt: skip
    said = [str(one) for one in check_project(str(project)) if one.code == "goal"]
    assert ["which needs (>= (charge) 5), here 2.0 >= 5" in one for one in said] == [True]


def test_an_object_without_the_value_that_others_have_is_named(project):
    planted(project, [
        ("domain.pddl", "(full))\n", "(full)) (:functions (size ?r - room))\n", ""),
        ("domain.pddl", ":precondition (robot-in ?from)", ":precondition (and (robot-in ?from) (>= (size ?to) 0))", ""),
        ("delivery.py", "        return Delta(\n            nodes", '        return Delta(\n            values={fact("size", "hall"): 3, fact("size", "office"): 2},\n            nodes', ""),
    ])  # fmt: skip
    (found,) = check_project(str(project))
    assert "no initial value of (size kitchen), which counts as 0" in str(found)


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ('removed=(fact("robot-in", before),)', 'removed=(fact("robot_in", before),)', "no predicate or function 'robot_in'; did you mean 'robot-in'?"),
        ('removed=(fact("robot-in", before),)', 'removed=(fact("robot-in"),)', "'robot-in' takes 1 argument, as in (robot-in ?r - room); found 0"),
        ('removed=(fact("robot-in", before),)', 'removed=(fact("robot-in", *[before]),)', None),
    ],
)  # fmt: skip
def test_facts_in_python_are_checked_with_their_line(project, right, wrong, said):
    planted(project, [("delivery.py", right, wrong, "")])
    found = [one for one in check_project(str(project)) if one.code == "fact"]
    assert len(found) == (said is not None)
    if said is not None:
        line = (project / "delivery.py").read_text().split(wrong)[0].count("\n") + 1
        assert str(found[0]).startswith(f"{project / 'delivery.py'}:{line}:")
        assert said in str(found[0])


def test_a_mistake_in_one_plot_file_is_the_only_finding(project):
    planted(project, [("plots/drive.yaml", "parameters:", "parameterss:", "")])
    (found,) = check_project(str(project))
    assert "unknown key 'parameterss'" in str(found)


def test_an_object_in_a_profile_is_checked(project):
    (project / "profiles" / "other.yaml").write_text("profile: other\nplots: {drive: {to: ofice}}\n")
    (found,) = check_project(str(project))
    assert "profiles/other.yaml:2:" in str(found)
    assert "there is no object 'ofice' of type room; did you mean 'office'?" in str(found)
    (project / "profiles" / "other.yaml").rename(project / "profiles" / "other.yml")
    (found,) = check_project(str(project))
    assert "the name of a profile's file ends in `.yaml`" in str(found)


def test_mistakes_in_texts_of_a_python_file_have_its_lines(tmp_path):
    robot = tmp_path / "waver.py"
    robot.write_text(
        '''from textwrap import dedent

from dsc import parse_plot
from planning import Bundle, PlanningDomain

DOMAIN = """(define (domain waving)
  (:predicates (waved))
  (:action wave :parameters () :effect (waved)))
"""
MAIN = parse_plot("""
plot: main
states:
  a: {use: wave_, on: {done: b}}
  b: {final: true}
""")
WAVE = parse_plot(
    dedent("""
        plot: wave
        implements: wav
        states: {a: {final: true}}
    """)
)
robot = Bundle(name="waver", about="waves", domain=PlanningDomain.parse(DOMAIN), plots=[MAIN, WAVE], main="main")
'''
    )
    found = {(Path(one.place.source or "").name, one.place.line, one.place.column)
             for one in check_project(str(robot)) if one.place is not None and one.level == "error"}  # fmt: skip
    assert found == {("waver.py", 8, 12), ("waver.py", 13, 7), ("waver.py", 19, 9)}


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("return [Left(", "[Left(", "House.left: it returns None instead of a list ("),
        ("return [Left(", "return str([Left(", "House.left: it returns '[]' instead of a list ("),
        ("return [Left(one, at, ", "return [(one, at, ", "House.left: it returns ('parcel1', "),
        ("return Delta(\n            nodes", "return dict(\n            nodes", "House.knowledge: it returns {'nodes': "),
        ("return [Wheels(self), Gripper(self)]", "[Wheels(self)]", "House.components: it returns None instead of a list ("),
        ("Gripper(self)]", "Gripper]", "delivery.py:25: a component is an instance of a subclass of Component, not <class"),
    ],
)  # fmt: skip
def test_a_wrong_result_of_the_simulation_is_found_with_the_line_of_its_method(project, right, wrong, said):
    text = (project / "delivery.py").read_text()
    assert right in text
    changed = text.replace(right, wrong, 1)
    if wrong.startswith("return str("):
        changed = changed.replace("if at != self.goes_to[one]]", "if at == self.goes_to[one]])")
    (project / "delivery.py").write_text(changed)
    (found,) = [str(one) for one in check_project(str(project)) if "simulation" not in str(one)][:1]
    assert said in found
    assert "delivery.py:" in found


def test_a_simulation_whose_rest_fails_at_the_beginning_is_no_mistake(project):
    planted(project, [("delivery.py", "return [Left(", "return [] if self.ended else [Left(", "")])
    assert check_project(str(project)) == []


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("simulation=House,", "components=[1],", "delivery.py:{line}: .*`components` is a function that returns a list"),
        ("simulation=House,", "components=lambda: 1,", "`components` of the bundle 'delivery' returns 1 instead of a list"),
        ("    @skill\n    async def put(", "    def stop(self): ...\n\n    @skill\n    async def put(",
         "delivery.py:{line}: 'stop' of component 'gripper' is a coroutine: write `async def stop`"),
        ("robot = Bundle", 'skill(after_crash="sens")\nrobot = Bundle', "delivery.py:{line}: .*did you mean 'sense'"),
    ],
)  # fmt: skip
def test_mistakes_at_the_entrances_of_a_robot_have_their_line(project, right, wrong, said):
    planted(project, [("delivery.py", right, wrong, "")])
    lines = (project / "delivery.py").read_text().splitlines()
    marks = ("def stop(self)", 'skill(after_crash="sens")', "robot = Bundle.in_folder(")
    line = next(n for mark in marks for n, text in enumerate(lines, 1) if mark in text)
    found = [str(one) for one in check_project(str(project))]
    assert any(re.search(said.format(line=line), one) for one in found), found
