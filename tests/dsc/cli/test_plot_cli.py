"""`dsc plot` on files as people have them: right, wrong, unreadable, and without their neighbours."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from dsc.cli.plots import app
from dsc.components.assembly import robot_of
from dsc.text.plot_files import parse_plot
from knowledge_base.errors import InputError

ROOT = Path(__file__).parents[3]
SHIPPED = ROOT / "domains" / "clean_up_table" / "plots"

GOOD = """
plot: good
states:
  work: {use: helper, on: {done: over}}
  over: {final: true}
"""
HELPER = "plot: helper\nstates:\n  look: {on: {seen: over}, entry: {trigger: camera.look}}\n  over: {final: true}\n"
DOMAIN = "(define (domain d) (:types cup table) (:predicates (on ?c - cup ?t - table)))"


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def written(folder: Path, **files: str) -> Path:
    for name, text in files.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder / f"{next(iter(files))}.yaml"


def findings(*words: object) -> list[dict[str, Any]]:
    result = run("check", "--json", *words)
    found: list[dict[str, Any]] = json.loads(result.output)
    assert result.exit_code == (2 if found else 0)
    return found


# -- check -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "file", sorted([*SHIPPED.glob("*.yaml"), *(ROOT / "planning" / "plots").glob("*.yaml")]), ids=lambda f: f.stem
)
def test_shipped_plots_have_no_findings(file: Path) -> None:
    assert findings(file) == []


def test_good_plots_are_said_to_be_good(tmp_path: Path) -> None:
    file = written(tmp_path, good=GOOD, helper=HELPER)
    result = run("check", file, tmp_path / "helper.yaml")
    assert (result.exit_code, result.output) == (0, "2 plots checked, no mistakes found\n")


def test_a_typo_is_one_line_with_place_and_remedy(tmp_path: Path) -> None:
    file = written(tmp_path, good=GOOD.replace("done: over", "done: ovre"), helper=HELPER)
    result = run("check", file)
    assert result.exit_code == 2
    assert result.output == f"{file}:4:28: there is no state 'ovre'; did you mean 'over'? [target]\n"


def test_findings_as_data(tmp_path: Path) -> None:
    file = written(tmp_path, good=GOOD.replace("done: over", "done: ovre"), helper=HELPER)
    assert findings(file) == [
        {
            "file": str(file), "line": 4, "column": 28, "message": "there is no state 'ovre'",
            "found": "ovre", "nearest": "over", "code": "target", "fix": None, "level": "error",
        }
    ]  # fmt: skip


def test_an_unknown_plot_is_a_finding_and_so_is_the_broken_file_that_may_hold_it(tmp_path: Path) -> None:
    file = written(tmp_path, good=GOOD)
    (alone,) = findings(file)
    assert alone["found"] == "helper"
    written(tmp_path, helper=HELPER.replace("final", "fnial"))
    first, second = findings(file)
    assert first == alone
    assert (second["found"], second["nearest"]) == ("fnial", "final")
    assert second["file"].endswith("helper.yaml")


def test_a_broken_neighbour_that_is_not_needed_is_no_finding(tmp_path: Path) -> None:
    assert findings(written(tmp_path, good=GOOD, helper=HELPER, broken="plot: [")) == []


def test_files_that_cannot_be_read_do_not_stop_the_others(tmp_path: Path) -> None:
    file = written(tmp_path, broken="plot: [", good=GOOD)
    found = findings(file, tmp_path / "missing.yaml", tmp_path / "good.yaml")
    assert [Path(one["file"]).stem for one in found] == ["broken", "missing", "good", "broken"]
    assert run("check", tmp_path / "missing.yaml").output.startswith(f"{tmp_path / 'missing.yaml'}: there is no file")


GUARDED = HELPER.replace("{seen: over}", "{seen: [{to: over, when: (onn cup1 table1)}, over]}")


@pytest.mark.parametrize("beside", [True, False])
def test_conditions_are_checked_against_the_domain_beside_or_above(tmp_path: Path, *, beside: bool) -> None:
    folder = tmp_path / "plots"
    folder.mkdir()
    file = written(folder, helper=GUARDED)
    assert findings(file) == []
    ((folder if beside else tmp_path) / "domain.pddl").write_text(DOMAIN)
    (finding,) = findings(file)
    assert (finding["found"], finding["nearest"], finding["code"]) == ("onn", "on", "condition")


def test_the_domain_can_be_named_and_must_be_readable(tmp_path: Path) -> None:
    file = written(tmp_path, helper=GUARDED)
    domain = tmp_path / "other.pddl"
    domain.write_text(DOMAIN)
    assert findings("--domain", domain, file)
    domain.write_text("(define (domain d) (:types")
    assert isinstance(run("check", "--domain", domain, file).exception, InputError)


def test_a_goal_needs_no_planner_to_be_checked(tmp_path: Path) -> None:
    state = "{goal: (tidy), on: {done: over, no_plan: over, gave_up: over}}"
    assert findings(written(tmp_path, a=f"plot: a\nstates:\n  clear: {state}\n  over: {{final: true}}\n")) == []


# -- show --------------------------------------------------------------------------------------------------


def test_connectors_and_times_are_shown_in_the_tree(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text("""
plot: p
outputs: {n: {type: number, initial: 0}}
states:
  a: {at_least: 2, on_break: {switch: arm, to: up}, every: {seconds: 0.5, to: b}, on: {done: w}}
  w: {select: ?n, cases: {1: {to: a, assign: {n: 2}}}, else: c}
  c: {choice: [{when: (> ?n 3), to: a}, b]}
  b: {final: true}
""")
    lines = [line.lstrip("│├└─ ") for line in run("show", file).output.splitlines()]
    for line in (
        "outputs: n: number", "at least 2 s", "break / arm → up", "every 0.5 s → b", "w  select ?n",
        "1 → a  / n := 2", "→ c  [else]", "c  choice", "→ a  [(> ?n 3)]", "→ b  [else]",
    ):  # fmt: skip
        assert line in lines


def test_a_plot_is_shown_as_a_tree() -> None:
    result = run("show", SHIPPED / "report.yaml")
    assert result.exit_code == 0
    lines = result.output.splitlines()
    assert lines[0].startswith("report")
    for part in ("● approach  use drive_planned(operator)", "done → tell", "told  final", "no_path → tell"):
        assert any(line.endswith(part) for line in lines), part
    assert "approach_no_path_0_wait" not in result.output
    assert "approach_no_path_0_wait" in run("show", "--expanded", SHIPPED / "report.yaml").output


def test_brackets_in_plots_are_not_markup(tmp_path: Path) -> None:
    file = written(tmp_path, a="plot: a\nabout: '[bold]loud[/bold]'\nstates:\n  s: {final: true}\n")
    assert "[bold]loud[/bold]" in run("show", file).output


def test_a_drawing_goes_to_a_file_or_to_standard_output(tmp_path: Path) -> None:
    out = tmp_path / "out.svg"
    assert run("show", SHIPPED / "report.yaml", "--svg", out).output == ""
    printed = run("show", SHIPPED / "report.yaml", "--svg", "-").output
    assert printed == out.read_text()
    assert printed.startswith("<svg ")
    assert "approach_no_path_0_wait" in printed


def test_a_drawing_that_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    error = run("show", SHIPPED / "report.yaml", "--svg", tmp_path / "no" / "out.svg").exception
    assert isinstance(error, InputError)
    assert "cannot write" in str(error)


def test_yaml_gives_the_same_plot_back_with_rules_as_rules_or_carried_out() -> None:
    file = SHIPPED / "search.yaml"
    assert parse_plot(run("show", file, "--yaml").output) == parse_plot(file.read_text())
    expanded = parse_plot(run("show", file, "--yaml", "--expanded").output)
    assert not expanded.rules
    assert any(t.rule for _, state, _ in expanded.walk() for _, t in getattr(state, "transitions", tuple)())


def test_show_of_an_invalid_plot_raises_an_error_with_its_reason(tmp_path: Path) -> None:
    assert isinstance(run("show", tmp_path / "missing.yaml").exception, InputError)
    ruled = GOOD + "rules:\n  - {on: x, do: {then: retry}}\n"
    file = written(tmp_path, good=ruled)
    assert "there is no plot 'helper'" in str(run("show", "--expanded", file).exception)
    written(tmp_path, helper="plot: [")
    assert "not readable as YAML" in str(run("show", "--svg", "-", file).exception)


# -- schema and start-up -----------------------------------------------------------------------------------


def test_the_schema_is_json_schema_of_plots() -> None:
    schema = json.loads(run("schema").output)
    assert {"plot", "states", "rules"} <= set(schema["properties"])


def test_help_is_light() -> None:
    heavy = ("pydantic", "networkx", "unified_planning", "ruamel.yaml", "dsc.model.plot")
    code = f"import sys, dsc.cli.plots; print([m for m in {heavy!r} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


# -- with the components of a robot ----------------------------------------------------------------------------

ROBOT = """
from dsc import Component, Outcome, skill


class Grasped(Outcome): ...


class Slipped(Outcome): ...


class Arm(Component):
    name = "arm"

    @skill
    async def grasp(self, call) -> Grasped | Slipped:
        return Grasped()


def components():
    return [Arm()]


number = 7


def broken():
    raise RuntimeError("no arm today")
"""
GRASPS = "plot: grasps\nstates:\n  s: {entry: {trigger: arm.grasp}, on: {grasped: e}}\n  e: {final: true}\n"


@pytest.fixture
def robot(tmp_path, monkeypatch):
    (tmp_path / "some_robot.py").write_text(ROBOT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield written(tmp_path, grasps=GRASPS)
    sys.modules.pop("some_robot", None)


@pytest.mark.parametrize("name", ["components", "Arm"])
def test_with_a_robot_skills_are_checked_too(robot, name):
    assert run("check", robot).exit_code == 0
    result = run("check", robot, "--robot", f"some_robot:{name}")
    assert result.exit_code == 2
    assert "state 's' does not handle its outcome 'slipped'" in result.output
    robot.write_text(GRASPS.replace("arm.grasp", "arm.grsp"))
    assert (
        "no component offers the skill or event 'arm.grsp'"
        in run("check", robot, "--robot", f"some_robot:{name}").output
    )


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ("some_robot", "a robot is named as MODULE:NAME, not 'some_robot'"),
        ("some_robt:components", "the module 'some_robt' cannot be imported: ModuleNotFoundError"),
        ("some_robot:componets", "there is no 'componets' in the module 'some_robot'; did you mean 'components'?"),
        ("some_robot:number", "a component is an instance of a subclass of Component, not 7"),
        ("some_robot:broken", "'some_robot:broken' cannot be called: RuntimeError: no arm today ("),
    ],
)
def test_an_invalid_robot_name_is_refused_with_its_reason(robot, named, said):
    with pytest.raises(InputError) as refused:
        robot_of(named)
    assert said in str(refused.value)
