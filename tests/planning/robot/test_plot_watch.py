"""Plot files that change while a robot runs: `dsc run --watch` (S2.8)."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from textwrap import dedent
from typing import IO

import pytest

from dsc import Component, Outcome, SkillCall, load_library, run_simulated, skill
from dsc.sequencer.sequencer import Sequencer
from dsc.text.profiles import adapted, parse_profile
from dsc.trace import Record
from knowledge_base.language.syntax.expression import Constant
from planning import Robot
from planning.robot.plot_watch import PlotFiles

MAIN = """\
plot: main
variables: {rounds: {type: number, initial: 0}}
states:
  work: {use: part, on: {done: {to: pause, assign: {rounds: (+ ?rounds 1)}}}}
  pause:
    after:
      - {seconds: 1, when: (< ?rounds 5), to: work}
      - {seconds: 1, when: (>= ?rounds 5), to: over}
  over: {final: true}
"""
PART = """\
plot: part
states:
  first: {entry: {trigger: arm.move, with: {to: a}}, on: {moved: end}}
  end: {final: true}
"""


class Moved(Outcome): ...


class Arm(Component):
    name = "arm"

    def __init__(self) -> None:
        super().__init__()
        self.moves: list[str] = []

    @skill
    async def move(self, call: SkillCall, to: str) -> Moved:
        self.moves.append(to)
        await call.clock.sleep(1.0)
        return Moved()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "main.yaml").write_text(MAIN, "utf-8")
    (tmp_path / "part.yaml").write_text(PART, "utf-8")
    return tmp_path


def edited(folder: Path, *edits) -> tuple[list[str], list[str], list[Record]]:
    """Run with one edit every 2 s, and return the moves, the lines for the author, and the records."""
    arm, lines, records = Arm(), list[str](), list[Record]()
    robot = Robot("(define (domain d) (:predicates (p)))", load_library(folder), [arm])
    robot.listen(records.append)
    files = PlotFiles(robot.library)

    async def main():
        sequencers: list[Sequencer] = []
        run = robot.start("main", prepare=sequencers.append)
        for edit in edits:
            await asyncio.sleep(2.0)
            edit(folder)
            lines.extend(files.update(sequencers[0]))
        end = await run
        assert end.reached

    run_simulated(main())
    return arm.moves, lines, records


def write(name: str, text: str):
    return lambda folder: (folder / name).write_text(text, "utf-8")


def test_an_edited_plot_is_replaced_and_the_robot_continues(folder):
    moves, lines, records = edited(folder, write("part.yaml", PART.replace("to: a", "to: b")))
    assert "".join(moves) in ("abbbb", "aabbbb", "aabbb")
    assert lines == ["replaced: part"]
    assert [one.data for one in records if one.type == "plots"] == [{"replaced": ["part"], "active": "keep"}]


def test_mistakes_are_reported_with_their_place_and_change_nothing(folder):
    moves, lines, _ = edited(
        folder,
        write("part.yaml", PART.replace("arm.move", "arm.mve")),
        write("part.yaml", PART.replace("states:", "states")),
        write("part.yaml", ""),  # an editor is writing
    )
    assert moves == ["a"] * 5
    assert len(lines) == 2
    assert lines[0].startswith(f"not replaced: {folder / 'part.yaml'}:3:")
    assert "did you mean 'arm.move'?" in lines[0]
    assert lines[1].startswith(f"not changed: {folder / 'part.yaml'}:")


def test_a_new_plot_and_its_user_arrive_together(folder):
    def edit(folder: Path):
        (folder / "more.yaml").write_text(PART.replace("plot: part", "plot: more").replace("to: a", "to: c"), "utf-8")
        (folder / "main.yaml").write_text(MAIN.replace("use: part", "use: more"), "utf-8")
        (folder / "part.yaml").unlink()

    moves, lines, _ = edited(folder, edit)
    assert lines == ["installed: more", "replaced: main", "removed: part"]
    assert moves[0] == "a"
    assert moves[-1] == "c"


def test_an_edited_plot_has_the_values_of_the_profile(folder):
    part = PART.replace("states:", "parameters: {times: {type: number, default: 1}}\nstates:", 1)
    main = MAIN.replace("variables:", "parameters: {times: {type: number, default: 1}}\nvariables:", 1)
    write("part.yaml", part)(folder)
    write("main.yaml", main)(folder)
    profile = parse_profile("{profile: fast, plots: {part: {times: 3}, main: {times: 2}}}")
    robot = Robot("(define (domain d) (:predicates (p)))", adapted(load_library(folder), profile), [Arm()])
    files, lines = PlotFiles(robot.library, profile), list[str]()

    async def live():
        sequencers: list[Sequencer] = []
        run = robot.start("main", prepare=sequencers.append)
        await asyncio.sleep(0.5)
        write("part.yaml", part.replace("to: a", "to: b"))(folder)
        lines.extend(files.update(sequencers[0]))
        await asyncio.sleep(0.1)
        default = sequencers[0].library.plot("part").parameters["times"].default
        await run
        return default

    assert run_simulated(live()) == Constant(3)
    assert lines == ["replaced: part"]


ROBOT = """
from pathlib import Path
from dsc import Component, Outcome, SkillCall, load_library, skill
from planning import Bundle


class Moved(Outcome): ...


class Arm(Component):
    name = "arm"

    @skill
    async def move(self, call: SkillCall, to: str) -> Moved:
        await call.clock.sleep(0.2)
        print("moved to", to, flush=True)
        return Moved()


BUNDLE = Bundle("arm", plots=tuple(load_library(Path(__file__).parent)), components=lambda: [Arm()], main="main")
"""


def test_a_command_watches_the_files(folder):
    endless = dedent("""\
        plot: main
        states:
          work: {use: part, on: {done: work}}
        """)
    (folder / "main.yaml").write_text(endless, "utf-8")
    (folder / "robot.py").write_text(ROBOT, "utf-8")
    command = [str(Path(sys.executable).with_name("dsc")), "run", str(folder / "robot.py"), "--real-time", "--watch"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ) as run:
        assert run.stdout is not None
        assert run.stderr is not None
        _until(run.stdout, "moved to a")
        (folder / "part.yaml").write_text(PART.replace("to: a", "to: b"), "utf-8")
        _until(run.stdout, "moved to b")
        assert "replaced: part" in run.stderr.readline()
        (folder / "part.yaml").write_text(PART.replace("to: a", "too: b"), "utf-8")
        assert "not replaced: " in _until(run.stderr, "part.yaml:3:")
        _until(run.stdout, "moved to b")
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=30)


def _until(stream: IO[str], text: str) -> str:
    began = time.monotonic()
    while time.monotonic() - began < 30:
        line = stream.readline()
        if text in line:
            return line
    raise AssertionError(f"no line has {text!r}")
