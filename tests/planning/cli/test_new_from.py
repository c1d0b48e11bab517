"""`dsc new --from`: a project of three plots runs; edits of the plots change only its generated files."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dsc.editing.surgery import Add, Edit, Move, Remove, RenameState, RenameVariable, Replace, apply

DSC = Path(sys.executable).with_name("dsc")
PLOTS = {
    "tidy": """\
# The main plot.
plot: tidy
emits: {unreachable: {}}
states:
  go:
    use: drive
    with: {to: shelf}
    on: {done: take, unreachable: lost}
  take: {use: grasp, with: {item: cup}, on: {done: over, slipped: go}}
  lost: {final: true, emit: unreachable}
  over: {final: true}
""",
    "drive": """\
plot: drive
parameters: {to: place}
emits: {unreachable: {}}
states:
  move:
    entry: {trigger: base.drive, with: {to: ?to, speed: 0.5}}
    on: {arrived: there, blocked: stuck}   # a door
  there: {final: true}
  stuck: {final: true, emit: unreachable}
""",
    "grasp": """\
plot: grasp
parameters: {item: item}
variables: {weight: {type: number, initial: 0}}
emits: {slipped: {item: item}}
states:
  close:
    entry: {trigger: hand.close, with: {item: ?item}}
    on:
      held: {to: over, assign: {weight: ?event.weight}}
      slipped: {to: lost, emit: slipped, with: {item: ?event.item}}
  over: {final: true}
  lost: {final: true}
""",
}
EDITS: list[tuple[str, Edit]] = [
    ("drive", RenameState(("states", "move"), "travel")),
    ("drive", Add(("states", "look", "entry"), {"trigger": "camera.look", "with": {"at": "?to"}})),
    ("drive", Add(("states", "look", "on", "seen"), "there")),
    ("drive", Replace(("states", "travel", "on", "arrived", 0), "look")),
    ("drive", RenameVariable(("parameters", "to"), "goal")),
    ("drive", RenameVariable(("parameters", "goal"), "to")),
    ("drive", Move(("states", "look"), ("states", "look"), before="there")),
    ("grasp", Add(("states", "over", "about"), "the hand holds it")),
    ("grasp", Add(("states", "close", "entry", 0, "with", "force"), 3)),
    ("grasp", Remove(("states", "over", "about"))),
]


def run(*words, cwd, status=0):
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture
def project(tmp_path):
    (tmp_path / "plots").mkdir()
    for name, text in PLOTS.items():
        (tmp_path / "plots" / f"{name}.yaml").write_text(text)
    run(DSC, "new", "--from", "plots", "tidy_bot", cwd=tmp_path)
    return tmp_path / "tidy_bot"


def types(project, status=0):
    command = [sys.executable, "-m", "mypy", "--strict", "-p", "tidy_bot", "--cache-dir", project / ".mypy_cache"]
    return run(*command, cwd=project, status=status)


def test_a_project_of_three_plots(project):
    assert "no mistakes found" in run(DSC, "check", cwd=project)
    types(project)
    assert "6 passed" in run(sys.executable, "-m", "pytest", "-q", "-p", "no:asyncio", cwd=project)


def test_plots_and_persons_files_after_edits_of_both(project):
    inside = project / "tidy_bot"
    own = [one for one in sorted(project.rglob("*.py")) if "generated" not in one.parts]
    for number in range(10):
        file = own[number % len(own)]
        file.write_text(file.read_text() + f"\n# My remark {number}.\n")
    for name, edit in EDITS:
        plot = inside / "plots" / f"{name}.yaml"
        plot.write_text(apply(plot.read_text(), edit))
    before = {file: file.read_bytes() for file in [*own, *(inside / "plots").iterdir()]}
    said = run(DSC, "new", "--from", "tidy_bot/tidy_bot/plots", "tidy_bot", cwd=project.parent)
    assert "made tidy_bot/tidy_bot/skills/camera.py" in said
    assert {file: file.read_bytes() for file in before} == before
    assert "incompatible with supertype" in types(project, status=1)
    hand = inside / "skills" / "hand.py"
    hand.write_text(hand.read_text().replace("item: Item)", "item: Item, force: float)"))
    types(project)
    assert "6 passed" in run(sys.executable, "-m", "pytest", "-q", "-p", "no:asyncio", cwd=project)


def test_attributes_that_guards_compare(tmp_path):
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "sort.yaml").write_text("""
plot: sort
emits: {bad: {}}
states:
  see:
    entry: {trigger: eye.see}
    on:
      seen:
        - {to: over, when: (and (< 2 ?event.size) (= ?event.ok true) (= ?event.colour "Dark red"))}
        - {to: over, emit: bad}
  over: {final: true}
""")
    run(DSC, "new", "--from", "plots", "sorter", cwd=tmp_path)
    project = tmp_path / "sorter"
    assert 'Seen(size=3, ok=True, colour="Dark red")' in (project / "sorter" / "skills" / "eye.py").read_text()
    assert "Goal reached" in run(DSC, "run", ".", cwd=project)
    assert "passed" in run(sys.executable, "-m", "pytest", "-q", "-p", "no:asyncio", cwd=project)


def test_a_main_plot_with_an_outcome_that_is_a_failure(project):
    plot = project / "tidy_bot" / "plots" / "tidy.yaml"
    plot.write_text(plot.read_text().replace("done: over, slipped: go", "done: lost, slipped: over"))
    said = run(DSC, "run", ".", cwd=project, status=1)
    assert "Goal not reached" in said
    assert "unreachable" in said


def test_a_file_without_the_mark_is_kept(project):
    module = project / "tidy_bot" / "generated" / "components.py"
    module.write_text("# Mine.\n")
    said = run(DSC, "new", "--from", "tidy_bot/tidy_bot/plots", "tidy_bot", cwd=project.parent, status=2)
    assert "it may be yours" in said
    assert module.read_text() == "# Mine.\n"


def test_other_plots_than_those_of_the_project_are_named(project):
    plots = project.parent / "others"
    shutil.copytree(project / "tidy_bot" / "plots", plots)
    assert "differs" not in run(DSC, "new", "--from", "tidy_bot/plots", ".", cwd=project)
    changed = min(plots.glob("*.yaml"))
    changed.write_text(changed.read_text() + "# another one\n")
    said = run(DSC, "new", "--from", "../others", ".", cwd=project)
    assert f"tidy_bot/plots/{changed.name} differs from the given plot and stays" in said


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("{trigger: base.stop}", "'stop' of 'base' is an attribute of every component; rename it"),
        ("{trigger: base.go, with: {call: 1}}", "'base.go' cannot have the parameter 'call'"),
        ("{trigger: base.go, with: {self: 1}}", "'base.go' cannot have the parameter 'self'"),
        ("{trigger: base.class}", "'class' is not a name"),
    ],
)
def test_names_that_python_code_cannot_have(tmp_path, wrong, said):
    (tmp_path / "a.yaml").write_text(
        f"plot: a\nstates: {{s: {{entry: {wrong}, on: {{gone: e}}}}, e: {{final: true}}}}\n"
    )
    assert said in run(DSC, "new", "--from", "a.yaml", "robot", cwd=tmp_path, status=2)
    assert not (tmp_path / "robot").exists()


def test_outcomes_with_names_of_python_and_renamed_ones(tmp_path):
    (tmp_path / "a.yaml").write_text("""\
plot: a
states:
  s:
    entry: [{trigger: arm.pour}, {trigger: camera.track, as: {moved: hand_moved}}]
    on: {none: e, hand_moved: e}
  e: {final: true}
""")
    run(DSC, "new", "--from", "a.yaml", "robot", cwd=tmp_path)
    text = (tmp_path / "robot" / "robot" / "generated" / "components.py").read_text()
    assert 'class NoneOutcome(Outcome, event="none"):' in text
    assert "async def pour(self, call: SkillCall) -> NoneOutcome:" in text
    assert "-> NoneOutcome | Moved:" in text
    assert "no mistakes found" in run(DSC, "check", cwd=tmp_path / "robot")
    assert "readme" not in (tmp_path / "robot" / "pyproject.toml").read_text()
