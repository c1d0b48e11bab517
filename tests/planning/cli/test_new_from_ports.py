"""`dsc new --from` of plots with watched conditions, ports, modes, parameters and plots that they use."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dsc.editing.surgery import Add, Edit, Move, Remove, RenameState, RenameVariable, Replace, apply

DSC = Path(sys.executable).with_name("dsc")
DOMAIN = "(define (domain d) (:types item) (:constants cup - item) (:predicates (held ?i - item)))\n"
PLOTS = {
    "main": """\
# A dynamic state with conditions.
plot: main
emits: {lost: {}}
states:
  choose:
    dynamic: [reach, look]
    with: {item: cup, limit: 3}
    on: {done: over, no_candidate: gone, slipped: choose}
  gone: {final: true, emit: lost}
  over: {final: true}
""",
    "look": """\
# Ports and a condition over several components.
plot: look
parameters: {item: item, limit: number}
states:
  wait:
    entry:
      - {set: hand.speed, to: 0.5}
      - {switch: base, to: slow}
      - {wire: map.scan, to: rear.scan}
      - trigger: conditions.watch_truth
        with:
          condition: '"(and (not (held ?item)) (< hand.pose.height ?limit) (> (magnitude wrist.force.tool) 5))"'
          values: {item: ?item, limit: ?limit}
    on: {became_true: over, became_false: {}}
    after: {seconds: 60, to: wait}
  over: {final: true}
""",
    "reach": """\
# Parameters, and a plot inside with an outcome that a skill has, too.
plot: reach
when: (not (held ?item))
parameters: {item: item, limit: number}
emits: {slipped: {item: item}}
states:
  approach:
    use: look
    with: {item: ?item, limit: ?limit}
    on: {done: close}
  close:
    entry:
      - {trigger: hand.close, with: {item: ?item}}
      - {trigger: hand.watch_values, with: {condition: '"(or (silent tool 9) (< pose.height 1))"'}, as: {became_true: low, became_false: high}}
    on: {closed: check, slipped: {to: lost, emit: slipped, with: {item: ?item}}, low: check, high: {}}
  check:
    use: count
    entry: {trigger: camera.see}
    on: {done: over, seen: over}
  lost: {final: true}
  over: {final: true}
""",
    "count": """\
plot: count
emits: {seen: {}}
states:
  go: {entry: {trigger: camera.count}, on: {counted: over}}
  over: {final: true, emit: seen}
""",
}  # fmt: skip
EDITS: list[tuple[str, Edit]] = [
    ("main", RenameState(("states", "choose"), "act")),
    ("main", Add(("states", "act", "about"), "chooses")),
    ("look", Add(("states", "wait", "entry", 4), {"send": "voice.say", "with": {"text": "hello"}})),
    ("look", Replace(("states", "wait", "entry", 1, "to"), "careful")),
    ("look", Add(("states", "wait", "about"), "watches")),
    ("look", RenameVariable(("parameters", "limit"), "bound")),
    ("look", RenameVariable(("parameters", "bound"), "limit")),
    ("reach", Add(("states", "close", "entry", 0, "with", "force"), 3)),
    ("reach", Move(("states", "lost"), ("states", "lost"), before="close")),
    ("count", Remove(("states", "over", "emit"))),
    ("count", Add(("states", "over", "emit"), "seen")),
]  # fmt: skip


def run(*words, cwd, status=0):
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


def write(folder, plots=PLOTS):
    (folder / "plots").mkdir()
    (folder / "domain.pddl").write_text(DOMAIN)
    for name, text in plots.items():
        (folder / "plots" / f"{name}.yaml").write_text(text)


@pytest.fixture
def project(tmp_path):
    write(tmp_path)
    run(DSC, "new", "--from", "plots", "bot", cwd=tmp_path)
    return tmp_path / "bot"


def types(project):
    return run(sys.executable, "-m", "mypy", "--strict", "-p", "bot", "--cache-dir", project / ".types", cwd=project)


def runs(project):
    assert "6 passed" in run(sys.executable, "-m", "pytest", "-q", "-p", "no:asyncio", cwd=project)


def test_the_components_of_ports_and_conditions(project):
    text = (project / "bot/generated/components.py").read_text()
    assert "class Conditions" not in text
    for line in (
        'force = Push({"tool": "list of number"})', 'pose = Push({"height": "number"})', 'modes = ("slow",)',
        'scan = Stream({}, "rear.scan", optional=True)', "    speed: float = 1\n", "    scan = Push({})\n",
        "async def see(self, call: SkillCall) -> Seen:", "async def close(self, call: SkillCall, item: Item) -> Closed | Slipped:",
    ):  # fmt: skip
        assert line in text
    assert "BecameTrue" not in text
    assert "error" not in run(DSC, "check", cwd=project)
    types(project)
    runs(project)


def test_ten_edits_of_the_person_and_of_the_plots(project):
    inside = project / "bot"
    own = [one for one in sorted(project.rglob("*.py")) if "generated" not in one.parts]
    for number in range(10):
        file = own[number % len(own)]
        file.write_text(file.read_text() + f"\n# My remark {number}.\n")
    for name, edit in EDITS:
        plot = inside / "plots" / f"{name}.yaml"
        plot.write_text(apply(plot.read_text(), edit))
    before = {file: file.read_bytes() for file in [*own, *(inside / "plots").iterdir()]}
    assert "made bot/bot/skills/voice.py" in run(DSC, "new", "--from", "bot/bot/plots", "bot", cwd=project.parent)
    assert {file: file.read_bytes() for file in before} == before
    hand = inside / "skills/hand.py"
    hand.write_text(hand.read_text().replace("item: Item)", "item: Item, force: float)"))
    types(project)
    runs(project)


def test_all_incomplete_classes_in_one_check(project):
    for name, old in (("hand", "def close"), ("camera", "def see"), ("camera", "def count")):
        file = project / f"bot/skills/{name}.py"
        file.write_text(file.read_text().replace(old, "def mine_" + old[-3:]))
    said = run(DSC, "check", cwd=project, status=2)
    assert "bot/skills/hand.py:16: the class Hand lacks 'close'" in said
    assert "the class Camera lacks 'count', 'see'" in said


def test_a_plot_that_is_not_given(tmp_path):
    write(tmp_path, {"main": PLOTS["main"]})
    said = run(DSC, "new", "--from", "plots", "bot", cwd=tmp_path, status=2)
    assert "these plots are not given: 'look' (used by 'main'), 'reach' (used by 'main')" in said
    assert not (tmp_path / "bot").exists()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("'\"(< arm.mode.x 1)\"'", "'mode' of 'arm' is an attribute of every component; rename it"),
        ("'\"(< arm.class.x 1)\"'", "'class' is not a name"),
        ("'\"(< arm.lift.x 1)\"'", "'arm.lift' is a port and a skill or message; rename one"),
    ],
)
def test_ports_that_python_code_cannot_have(tmp_path, wrong, said):
    write(tmp_path, {"a": f"""\
plot: a
states:
  s:
    entry: [{{trigger: arm.lift}}, {{trigger: conditions.watch_truth, with: {{condition: {wrong}}}}}]
    on: {{lifted: e, became_true: e, became_false: e}}
  e: {{final: true}}
"""})  # fmt: skip
    assert said in run(DSC, "new", "--from", "plots", "bot", cwd=tmp_path, status=2)
