"""Real runs with a device that signals end at random moments: is it braked, closed one time, and resumed?

Each round starts `dsc run --real-time`, sends one signal or two, and resumes a kept run with further signals until it
ends. The device is the far end of a pseudo-terminal: it counts what reaches the wire. `make soak-signals` runs it.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections import Counter
from pathlib import Path

ROBOT = '''
import os
import time
from dsc import Component, Outcome, SkillCall, parse_plot, skill
from planning import Bundle


class Arrived(Outcome): ...


class Pressed(Outcome): ...


class Base(Component):
    """A base at a serial port."""

    name = "base"
    device_errors = (OSError,)

    async def start(self):
        self.port = os.open(os.environ["PORT"], os.O_RDWR | os.O_NOCTTY)
        self.write("open")

    async def stop(self):
        self.write("close")
        os.close(self.port)

    def write(self, text):
        os.write(self.port, f"{text}\\n".encode())

    async def configure(self, parameter, value):
        self.write(f"{parameter} {value:g}")

    async def receive(self, port, message):
        self.write(port)

    @skill(after_crash="repeat")
    async def drive(self, call: SkillCall, to: str) -> Arrived:
        self.write(f"drive {to}")
        await call.clock.sleep(0.1)
        self.write(f"there {to}")
        return Arrived()

    @skill
    async def press(self, call: SkillCall) -> Pressed:
        self.write(f"press {call.action_id}")
        await call.clock.sleep(0.1)
        return Pressed()

    @skill(blocking="process")
    def measure(self, call) -> Arrived:
        time.sleep(0.05)
        return Arrived()


plot = parse_plot("""
plot: go
states:
  trip:
    entry: {set: base.speed, to: 2}
    exit: {set: base.speed, to: 0}
    states:
      a: {entry: {trigger: base.drive, with: {to: a}}, on: {arrived: press}}
      press: {entry: {trigger: base.press}, on: {pressed: b, skill_error: b}}
      b: {entry: {trigger: base.measure}, on: {arrived: c, skill_error: c}}
      c: {entry: {trigger: base.drive, with: {to: c}}, on: {arrived: there}}
      there: {final: true}
    on: {done: over}
  over: {final: true}
""")
robot = Bundle("r", plots=(plot,), components=lambda: [Base()], main="go")
'''
BOUND = 10.0
"""Seconds within which a program ends after its first signal."""


class Wire:
    """The far end of a serial port: a pseudo-terminal, whose lines a thread reads."""

    def __init__(self) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.name = os.ttyname(slave)
        self._kept = slave  # so that the port outlasts the program that closes it
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        rest = b""
        while True:
            try:
                *whole, rest = (rest + os.read(self.master, 4096)).split(b"\n")
            except OSError:
                return
            self.lines += [line.decode() for line in whole]

    def take(self) -> list[str]:
        """Return the lines since the last call, after a moment for those on the way."""
        time.sleep(0.05)
        lines, self.lines = self.lines, []
        return lines


START = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may ignore signals in the background
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from planning.cli.command import main
main()
"""


def command(*more: str) -> list[str]:
    return [sys.executable, "-c", START, "run", *more]


def programs(mark: str) -> list[int]:
    """Return the ids of all processes with this text in their environment."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                if mark.encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


def problems_of(lines: list[str], *, killed: bool, twice: bool) -> list[str]:
    """Return what is wrong with the lines of one program, which a signal may have killed, or two signals."""
    found = []
    opened, closed = lines.count("open"), lines.count("close")
    over = not lines or lines[-1] == "close"  # a signal after the run kills the program
    if killed and not over:
        return [] if twice and opened == 1 else [f"killed after {lines}"]
    if opened > 1 or opened != closed or not over:
        found.append(f"opened {opened} times, closed {closed} times: {lines}")
    speeds = [line for line in lines if line.startswith("speed")]
    if speeds and speeds[-1] != "speed 0":
        found.append(f"not braked: {lines}")
    return found


class Round:
    """A robot whose programs signals end until one reaches the goal.

    Attributes:
        problems: what was wrong.
        counts: the ends of the programs, by signal.
    """

    def __init__(self, seed: int, counts: Counter[str]) -> None:
        self.draw = random.Random(seed)
        self.name = f"round {seed}"
        self.counts = counts
        self.problems: list[str] = []
        self.wire = Wire()
        self.presses: list[str] = []

    def play(self) -> list[str]:
        """Run the robot, and resume it until its end; return the problems."""
        with tempfile.TemporaryDirectory(prefix="signals-") as name:
            folder = Path(name)
            (folder / "robot.py").write_text(ROBOT)
            (folder / "temporary").mkdir()
            if not any(self.reaches_its_end(folder, signalled=attempt < 10) for attempt in range(12)):
                self.problems.append("the goal was not reached in 12 attempts")
        if len(self.presses) != len(set(self.presses)):
            self.problems.append(f"an action was executed twice: {self.presses}")
        return [f"{self.name}: {one}" for one in self.problems]

    def reaches_its_end(self, folder: Path, *, signalled: bool) -> bool:
        """Start or resume one program, send its signals, and return whether the run has ended."""
        store, mark = folder / "run.kb", f"{os.getpid()} {self.name} {time.monotonic()}"
        target = ["--resume", str(store)] if store.exists() else ["robot.py", "--real-time", "--store", str(store)]
        environment = {**os.environ, "PORT": self.wire.name, "MARK": mark, "TMPDIR": str(folder / "temporary")}
        program = subprocess.Popen(
            command(*target), cwd=folder, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        number = self.draw.choice([signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
        twice = self.draw.random() < 0.3
        self.wait_for_the_device(program)
        time.sleep(self.draw.uniform(0, 0.5))
        sent = time.monotonic()
        signalled = signalled and program.poll() is None
        if signalled:
            program.send_signal(number)
            if twice:
                time.sleep(self.draw.choice([0.0, 0.002, 0.05]))
                program.send_signal(number)
        try:
            _, errors = program.communicate(timeout=BOUND + 30)
        except subprocess.TimeoutExpired:
            program.kill()
            program.communicate()
            errors = "no end"
        lines, killed = self.wire.take(), program.returncode == -number
        late = time.monotonic() - sent > BOUND
        what = f"{number.name}{' twice' * twice}: {'killed' if killed else 'ended'}" if signalled else "no signal"
        self.counts[what] += 1
        found = problems_of(lines, killed=killed, twice=twice)
        found += [f"after {BOUND:g} s"] * late + [errors[-2000:]] * ("Traceback" in errors or program.returncode == 2)
        found += [f"left: {what}" for what in (*programs(mark), *(folder / "temporary").iterdir())]
        ended = program.returncode == 0 or "no unfinished run" in errors  # or the last signal came after the end
        self.problems += [] if "no unfinished run" in errors else [f"{what}: {one}" for one in found]
        self.presses += [line for line in lines if line.startswith("press")]
        return ended

    def wait_for_the_device(self, program: subprocess.Popen[str]) -> None:
        """Wait until the program writes to the device, or ends."""
        started = time.monotonic()
        while not self.wire.lines and program.poll() is None and time.monotonic() - started < 30:
            time.sleep(0.005)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rounds", type=int, nargs="?", default=25)
    parser.add_argument("first", type=int, nargs="?", default=0)
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    problems = [one for seed in range(given.first, given.first + given.rounds) for one in Round(seed, counts).play()]
    for what, number in sorted(counts.items()):
        print(f"{number:5} {what}")
    for one in problems:
        print(one)
    print(f"{len(problems)} problems in {sum(counts.values())} runs")
    return bool(problems)


if __name__ == "__main__":
    sys.exit(main())
