"""A device is opened one time and closed one time in each run, whichever way the run ends."""

from __future__ import annotations

import asyncio
import os
import select
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from dsc import Component, Outcome, SkillCall, parse_plot, skill
from dsc.sequencer.clock import ClockKind, SimulatedEventLoop, run_simulated
from planning import Bundle, deploy
from planning.robot.bringup import resume

PLOT = parse_plot("""
plot: turn
states:
  left: {entry: {trigger: gripper.turn, with: {degrees: -90}}, on: {turned: right}}
  right: {entry: {trigger: gripper.turn, with: {degrees: 90}}, on: {turned: over}}
  over: {final: true}
""")


class Turned(Outcome): ...


class Port:
    """A serial port, for which a pseudo-terminal stands."""

    def __init__(self) -> None:
        self.device, self._end = os.openpty()
        tty.setraw(self._end)
        self.name = os.ttyname(self._end)

    def take(self) -> list[str]:
        """Return what has reached the device since the last call; the kernel passes it on with a delay."""
        found = ""
        while select.select([self.device], [], [], 0.3)[0]:
            found += os.read(self.device, 10_000).decode()
        return found.split(";")[:-1]

    def close(self) -> None:
        os.close(self.device)
        os.close(self._end)


class Gripper(Component):
    """A gripper at the port; with `fails`, its second turn ends with this exception."""

    name = "gripper"
    device_errors = (OSError,)

    def __init__(self, port: Port, fails: BaseException | None = None) -> None:
        super().__init__()
        self.port = port
        self.fails = fails

    async def start(self) -> None:
        self.file = os.open(self.port.name, os.O_RDWR | os.O_NOCTTY)
        os.write(self.file, b"on;")

    async def stop(self) -> None:
        os.write(self.file, b"off;")
        os.close(self.file)

    @skill(after_crash="repeat")
    async def turn(self, call: SkillCall, degrees: float) -> Turned:
        os.write(self.file, f"turn {degrees:g};".encode())
        await call.clock.sleep(0.5)
        if self.fails is not None and degrees > 0:
            raise self.fails
        return Turned()


GOOD = ["on", "turn -90", "turn 90", "off"]


@pytest.fixture
def port() -> Iterator[Port]:
    made = Port()
    yield made
    made.close()


def robot(gripper: Gripper) -> Bundle:
    return Bundle("r", plots=(PLOT,), components=lambda: [gripper], main="turn")


@pytest.mark.parametrize("clock", ["real", "simulated"])
def test_in_a_good_run(port: Port, clock: ClockKind) -> None:
    with deploy(robot(Gripper(port)), clock=clock) as deployed:
        assert deployed.report().problem is None
    assert port.take() == GOOD


@pytest.mark.parametrize("error", [OSError("no power"), ValueError("a bug")])
def test_in_a_failed_run(port: Port, error: Exception) -> None:
    with deploy(robot(Gripper(port, fails=error)), clock="simulated") as deployed:
        report = deployed.report()
    assert str(error) in str(report.problem) + str(report.programming_error)
    assert port.take() == GOOD


def test_in_a_killed_and_resumed_run(port: Port, tmp_path: Path) -> None:
    killed = deploy(robot(Gripper(port)), store=tmp_path / "run.kb", clock="simulated")

    async def begin() -> None:
        kept.append(asyncio.ensure_future(killed.start("turn", header=killed.header())))
        await asyncio.sleep(0.6)

    kept: list[asyncio.Future[object]] = []  # a killed program cleans nothing up
    SimulatedEventLoop().run_until_complete(begin())
    killed.knowledge.close()
    assert port.take() == ["on", "turn -90", "turn 90"]
    with resume(robot(Gripper(port)), tmp_path / "run.kb") as deployed:
        assert deployed.report().problem is None
    assert port.take() == ["on", "turn 90", "off"]


def test_in_two_runs_in_a_row(port: Port) -> None:
    gripper = Gripper(port)
    for _ in range(2):
        with deploy(robot(gripper), clock="simulated") as deployed:
            assert deployed.report().problem is None
        assert port.take() == GOOD


def test_in_a_notebook(port: Port) -> None:
    """A notebook awaits runs in its own loop, with one executive; the user interrupts the second run."""

    async def cells() -> None:
        with deploy(robot(Gripper(port))) as deployed:
            await deployed.start("turn")
            assert port.take() == GOOD
            interrupted = asyncio.ensure_future(deployed.start("turn"))
            await asyncio.sleep(0.2)
            interrupted.cancel()
            with pytest.raises(asyncio.CancelledError):
                await interrupted
            assert port.take() == ["on", "turn -90", "off"]
            await deployed.start("turn")
            assert port.take() == GOOD

    run_simulated(cells())
