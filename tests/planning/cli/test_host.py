"""Robots in several processes: `dsc host`, `dsc ps`, `dsc call`, and a run whose host is killed or stopped."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from wire_programs import free_endpoint

from dsc.runs.archive import is_unfinished

pytest.importorskip("zenoh")

DSC = Path(sys.executable).with_name("dsc")
CELL = Path(__file__).parents[2] / "support" / "cell"
BOXES = [f"box{n}" for n in range(1, 6)]
CYCLES = int(os.environ.get("CYCLES", "1"))


BOSS = """
from dsc import parse_plot
from planning import Bundle

order = parse_plot('''
plot: order
emits: {failed: {}}
states:
  learn: {use: cleaner.share_knowledge, on: {done: go}}
  go: {goal: (robot-at sink), on: {done: over, no_plan: no, gave_up: no}}
  over: {final: true}
  no: {final: true, emit: failed}
''')
robot = Bundle("boss", remote=("cleaner",), plots=(order,), main="order", goal="(robot-at sink)")
"""


class Cell:
    """The programs of the cell, in a realm of their own."""

    def __init__(self, folder):
        self.endpoint, self.world = free_endpoint(), folder / "world.jsonl"
        self._programs = []

    def program(self, *arguments):
        """Start a command of this project."""
        environment = {**os.environ, "CELL_WORLD": str(self.world)}
        started = subprocess.Popen(
            [DSC, *arguments], cwd=CELL, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self._programs.append(started)
        return started

    def host(self, *options, target="cell.py:arm"):
        """Start a host, and return it when it hosts."""
        return self._hosting(self.program("host", target, "--listen", self.endpoint, *options))

    def host_again(self, ended):
        """Start the host again that was started with the same arguments."""
        return self._hosting(self.program(*ended.args[1:]))

    def _hosting(self, started):
        line = started.stdout.readline()
        assert line.startswith("hosting"), line + started.stdout.read()
        return started

    def host_both(self):
        """Host the arm and the robot, in two programs; the endpoint is then that of the robot."""
        arm = self.host()
        device, self.endpoint = self.endpoint, free_endpoint()
        return arm, self.host("--plots", "tidier", "--connect", device, target="cell.py")

    def said(self, *arguments, status=0):
        """Run a command to its end, and return its text."""
        done = self.program(*arguments, "--connect", self.endpoint)
        text, _ = done.communicate(timeout=60)
        assert done.returncode == status, text
        return text

    def lines(self):
        return [json.loads(line) for line in self.world.read_text().splitlines()]

    def close(self):
        for one in self._programs:
            if one.poll() is None:
                one.send_signal(signal.SIGCONT)
                one.kill()
                one.wait()
            one.stdout.close()


@pytest.fixture
def cell(tmp_path):
    made = Cell(tmp_path)
    yield made
    made.close()


def test_hosted_components_are_listed_called_and_set(cell):
    assert "no program hosts a component in the realm 'dsc'" in cell.said("ps")
    host = cell.host()
    assert cell.said("ps").split() == ["arm", "init", "neutral", "look,", "move"]
    assert json.loads(cell.said("call", "arm.move", "box=box1", "--json")) == {"event": "moved"}
    assert [(one["what"], one["box"]) for one in cell.lines()] == [("moved", "box1")]
    assert "needs its parameter 'box'" in cell.said("call", "arm.move", status=2)
    assert "has no skill 'mov'; did you mean 'move'" in cell.said("call", "arm.mov", status=2)
    assert "did you mean 'arm'" in cell.said("call", "amr.move", status=2)
    assert "another program hosts 'arm'" in cell.said("host", "cell.py:arm", status=2)
    host.send_signal(signal.SIGINT)
    assert host.wait(20) == 0


def test_a_run_waits_for_its_components_and_uses_them(cell):
    run = cell.program("run", "cell.py", "--connect", cell.endpoint, "--json")
    time.sleep(1)
    cell.host()
    text, _ = run.communicate(timeout=60)
    assert run.returncode == 0, text
    assert sorted(one["box"] for one in cell.lines() if one["what"] == "moved") == [f"box{n}" for n in range(1, 6)]


def test_a_component_that_nobody_hosts_is_named(cell):
    assert "no program hosts the component 'arm'" in cell.said("run", "cell.py", status=2)


def test_a_ready_world_is_planned_with_by_a_robot_of_a_few_lines(cell, tmp_path):
    robot = tmp_path / "boss.py"
    robot.write_text(BOSS)
    host = cell.program("host", "clean-up-table", "--plots", "cleaner", "--listen", cell.endpoint)
    assert host.stdout.readline().startswith("hosting cleaner")
    assert "there is no object 'sink'" in cell.said("check", str(robot))
    said = cell.said("run", str(robot))
    assert "(drive operator sink)" in said
    assert "Goal reached" in said


def test_a_later_host_takes_over_and_the_world_refuses_the_former_one(cell):
    former = cell.host()
    cell.said("call", "arm.look")
    former.send_signal(signal.SIGSTOP)
    cell.endpoint, old = free_endpoint(), cell.endpoint
    cell.host("--replace", "--connect", old)
    cell.said("call", "arm.look")
    former.send_signal(signal.SIGCONT)
    assert "later hosts have taken over" in former.communicate(timeout=20)[0]
    assert former.returncode == 2
    first, later = [one["fence"] for one in cell.lines()]
    assert first < later


def test_a_robot_is_a_component_of_another_program_with_a_device_of_a_third_one(cell):
    cell.host_both()
    assert cell.said("call", "tidier.tidy") == "{event: completed}\n"
    assert sorted(one["box"] for one in cell.lines() if one["what"] == "moved") == BOXES
    assert cell.said("call", "tidier.achieve", "goal=(on-table box1)") == "{event: completed}\n"
    assert "no predicate 'in-table'; did you mean 'on-table'" in cell.said(
        "call", "tidier.achieve", "goal=(in-table box1)", status=1
    )


def child_of(process):
    """Return the number of the only program that a process has started."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline and not (found := children.read_text().split()):
        time.sleep(0.01)
    return int(found[0])


def is_running(number):
    """Return whether a process runs; one that has ended may wait for its parent."""
    try:
        return Path(f"/proc/{number}/stat").read_text().split(")")[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="reads /proc")
def test_a_supervised_host_returns_after_a_crash_and_ends_with_its_supervisor(cell):
    supervisor = cell.host("--supervised")
    first = child_of(supervisor)
    assert cell.said("call", "arm.look") == "{event: seen}\n"
    os.kill(first, signal.SIGKILL)
    assert "ended by SIGKILL; it starts again in 0.5 s" in supervisor.stdout.readline()
    assert supervisor.stdout.readline().startswith("hosting arm")
    second = child_of(supervisor)
    assert second != first
    assert cell.said("call", "arm.look") == "{event: seen}\n"
    supervisor.kill()
    supervisor.wait()
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline and is_running(second):
        time.sleep(0.05)
    assert not is_running(second)


def test_a_robot_without_actions_plans_with_those_of_another_program(cell, tmp_path):
    cell.host_both()
    trace = tmp_path / "run.jsonl"
    cell.said("run", "cell.py:boss", "--trace", str(trace))
    assert Counter(one["box"] for one in cell.lines() if one["what"] == "moved") == dict.fromkeys(BOXES, 1)
    records = [json.loads(line) for line in trace.read_text().splitlines()[1:]]
    entered = {path for one in records for micro in one.get("microsteps", ()) for path in micro["entered"]}
    assert {f"work/execute/step_{n}/there/go" for n in range(1, 6)} <= entered


def test_the_hull_of_a_robot_is_read_and_set(cell):
    cell.host_both()
    assert json.loads(cell.said("call", "tidier", "--json"))["parameters"] == {"greet.words": "hello"}
    assert cell.said("call", "tidier.greet") == "{event: completed, said: hello}\n"
    cell.said("call", "tidier", "--set", "greet.words=good morning")
    assert cell.said("call", "tidier.greet") == "{event: completed, said: good morning}\n"
    assert cell.said("call", "tidier.greet", "words=bye") == "{event: completed, said: bye}\n"
    assert "did you mean 'greet.words'" in cell.said("call", "tidier", "--set", "greet.word=x", status=2)
    diagnosis = json.loads(cell.said("call", "tidier", "--diagnose", "--json"))
    assert diagnosis["runs"] == []
    assert diagnosis["parameters"] == {"greet.words": "good morning"}
    cell.said("call", "tidier", "--switch", "init")
    assert cell.said("call", "tidier.greet") == "{event: completed, said: good morning}\n"


def test_a_project_is_compared_with_the_hosted_components(cell):
    alone = cell.program("check", "cell.py:boss").communicate(timeout=60)[0]
    assert "there is no type 'box'" in alone
    assert "unless 'tidier' declares it" in alone
    cell.host_both()
    assert "no mistakes found" in cell.said("check", "cell.py:boss")


def active_states(trace):
    """Return the states that are active at the end of a trace; each is entered before its exit, and exits one time."""
    active: set[str] = set()
    for line in trace.read_text().splitlines()[1:]:
        for micro in json.loads(line).get("microsteps", ()):
            assert active.issuperset(micro["exited"])
            active.difference_update(micro["exited"])
            assert active.isdisjoint(micro["entered"])
            active.update(micro["entered"])
    return active


@pytest.mark.parametrize("seed", range(CYCLES))
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
@pytest.mark.parametrize("victim", ["the arm of a robot", "the arm of two robots", "the robot of a robot"])
def test_a_host_that_dies_or_hangs_moves_nothing_twice(cell, victim, number, seed):
    draw = random.Random(f"{victim} {number} {seed}")  # noqa: S311
    if victim == "the arm of a robot":
        hosts, target = [cell.host()], "cell.py"
    else:
        hosts, target = cell.host_both(), "cell.py:boss"
    host = hosts[victim == "the robot of a robot"]
    trace = cell.world.with_name("trace.jsonl")
    run = cell.program("run", target, "--connect", cell.endpoint, "--json", "--trace", str(trace))
    while not cell.world.exists():
        time.sleep(0.01)
    time.sleep(draw.uniform(0, 0.8))
    host.send_signal(number)
    if number == signal.SIGKILL:
        host.wait()
        time.sleep(draw.uniform(0, 0.5))
        cell.host_again(host)
    else:
        time.sleep(draw.uniform(1, 5))
        host.send_signal(signal.SIGCONT)
    text, _ = run.communicate(timeout=60)
    report = json.loads(next(line for line in text.splitlines() if line.startswith("{")))
    assert run.returncode == (0 if report["goal_reached"] else 1), text
    assert report["goal_reached"] or any(name in str(report["problem"]) for name in ("arm", "tidier")), text  # honest
    assert not active_states(trace)
    moved = Counter(one["box"] for one in cell.lines() if one["what"] == "moved")
    assert set(moved.values()) == {1}
    assert not report["goal_reached"] or set(moved) == set(BOXES)


@pytest.mark.parametrize("seed", range(CYCLES))
@pytest.mark.parametrize("target", ["cell.py", "cell.py:boss"])
def test_a_kept_run_that_is_killed_continues_with_its_remote_components(cell, tmp_path, target, seed):
    draw = random.Random(f"{target} {seed}")  # noqa: S311
    if target == "cell.py":
        cell.host()
    else:
        cell.host_both()
    store = tmp_path / "run.kb"
    run = cell.program("run", target, "--store", str(store), "--connect", cell.endpoint)
    while not cell.world.exists():
        time.sleep(0.01)
    time.sleep(draw.uniform(0, 0.5))
    run.kill()
    run.wait()
    if is_unfinished(store):  # else it was faster
        report = json.loads(cell.said("run", "--resume", str(store), "--json").splitlines()[-1])
        assert report["goal_reached"]
    assert Counter(one["box"] for one in cell.lines() if one["what"] == "moved") == dict.fromkeys(BOXES, 1)


def test_hosted_components_use_components_of_other_programs(cell):
    strangers = Path(__file__).parents[3] / "examples" / "strangers"
    battery = cell.host("--only", "accumulator", target=strangers / "robot.py")
    listening, cell.endpoint = cell.endpoint, free_endpoint()
    others = [word for name in ("front", "rear", "cartographer") for word in ("--only", name)]
    profile = ["--profile", strangers / "backwards.yaml"]
    cell.host(*others, *profile, "--connect", listening, target=strangers / "robot.py")
    cell.said("call", "cartographer", "--switch", "mapping")
    assert "metres=2.0, hours=1.5" in cell.said("call", "cartographer.survey", "--within", "5").replace(": ", "=")
    battery.kill()
    battery.wait()
    ended = cell.said("call", "cartographer.survey", "--within", "5", status=1)
    assert "the call of 'cartographer.energy' to 'accumulator.remaining' has no answer within 1 s" in ended


SURVEY_BEHIND = """
from dsc import parse_plot
from planning import Bundle

survey = parse_plot('''
plot: survey_behind
outputs: {metres: number}
states:
  map:
    entry: [{switch: cartographer, to: mapping}, {wire: cartographer.scan, to: rear.echo}]
    on: {done: over}
    states:
      wait: {after: {seconds: 2, to: ask}}
      ask:
        entry: {trigger: cartographer.survey}
        on: {surveyed: {to: known, assign: {metres: ?event.metres}}}
      known: {final: true}
  over: {final: true}
''')
robot = Bundle("behind", remote=("cartographer", "front", "rear"), plots=(survey,), main="survey_behind")
"""


def test_a_run_changes_the_wire_of_a_hosted_component(cell, tmp_path):
    strangers = Path(__file__).parents[3] / "examples" / "strangers"
    cell.host(target=strangers / "robot.py")
    target = tmp_path / "behind.py"
    target.write_text(SURVEY_BEHIND)
    report = json.loads(cell.said("run", target, "--json").splitlines()[-1])
    assert report["outputs"] == {"metres": 2.0}
    cell.said("call", "cartographer", "--switch", "mapping")
    deadline = time.monotonic() + 20.0
    while "metres: 1.0" not in (said := cell.said("call", "cartographer.survey", "--within", "5")):
        assert time.monotonic() < deadline, said  # the host has wired the front laser again


def test_hosted_components_are_monitored(cell, tmp_path):
    strangers = Path(__file__).parents[3] / "examples" / "strangers"
    cell.host(target=strangers / "robot.py")
    cell.said("call", "cartographer", "--switch", "mapping")
    drawn = tmp_path / "values.svg"
    said = cell.said("monitor", strangers / "monitor.yaml", "--seconds", "3", "--json", "--svg", drawn)
    found = [json.loads(line) for line in said.splitlines()]
    values = {(one["component"], one["entry"]): one["value"] for one in found}
    assert values["cartographer", "mode"] == "mapping"
    assert values["front", "program.memory_mib"] > 1
    assert sum(one["entry"] == "program.memory_mib" for one in found) >= 2
    assert "front.program.memory_mib" in drawn.read_text()
