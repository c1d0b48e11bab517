"""SIGTERM and SIGHUP stop the components of a run: without a store the run ends, with a store it can be resumed."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys

import pytest

from dsc import Component, Outcome, SkillCall, parse_plot, skill, takes
from dsc.sequencer.clock import run_real
from knowledge_base import StoreError
from planning import Bundle, deploy
from planning.deployment import resume

PLOT = parse_plot("""
plot: go
states:
  drive: {entry: [{set: base.speed, to: 2}, {trigger: base.drive}], exit: {send: base.brake}, on: {arrived: over}}
  over: {final: true}
""")


class Arrived(Outcome): ...


class Base(Component):
    """Raises a signal while it drives for the first time."""

    name = "base"

    def __init__(self, number: int | None = None) -> None:
        super().__init__()
        self.number = number
        self.log: list[str] = []

    async def configure(self, parameter: str, value: object) -> None:
        self.log.append(f"{parameter} {value}")

    async def stop(self) -> None:
        self.log.append("stop")

    @skill(after_crash="repeat")
    async def drive(self, call: SkillCall) -> Arrived:
        self.log.append("on")
        try:
            if self.number is not None:
                signal.raise_signal(self.number)
            await call.clock.sleep(0.01)
        finally:
            self.log.append("off")
        return Arrived()

    @takes
    async def brake(self) -> None:
        self.log.append("brake")


def robot(base: Base) -> Bundle:
    return Bundle("r", plots=(PLOT,), components=lambda: [base], main="go")


@pytest.mark.parametrize("simulated", [True, False])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_run_without_a_store(number: signal.Signals, *, simulated: bool) -> None:
    base = Base(number)
    with deploy(robot(base)) as deployed:
        report = deployed.run(simulated=simulated)
    assert report.problem == f"{number.name} ended the run"
    assert sorted(base.log[2:-1]) == ["brake", "off"]
    assert (base.log[:2], base.log[-1]) == (["speed 2", "on"], "stop")
    assert signal.getsignal(number) is signal.SIG_DFL


@pytest.mark.parametrize("simulated", [True, False])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_suspends_a_run_with_a_store(tmp_path, number: signal.Signals, *, simulated: bool) -> None:
    base = Base(number)
    with deploy(robot(base), store=tmp_path / "run.kb") as deployed:
        report = deployed.run(simulated=simulated)
    assert report.problem == f"{number.name} suspended the run, which can be resumed"
    assert sorted(base.log[2:-1]) == ["brake", "off"]
    assert base.log[-1] == "stop"

    again = Base()
    with resume(robot(again), tmp_path / "run.kb") as deployed:
        report = deployed.run()
    assert report.problem is None
    assert again.log == ["speed 2", "on", "off", "brake", "stop"]


def test_ctrl_c_ends_a_run_with_a_store(tmp_path) -> None:
    base = Base(signal.SIGINT)
    with deploy(robot(base), store=tmp_path / "run.kb") as deployed:
        assert deployed.run().problem == "the operator ended the run"
    assert "brake" in base.log
    with pytest.raises(StoreError), resume(robot(base), tmp_path / "run.kb") as deployed:
        deployed.run()


def test_a_signal_that_the_program_handles_remains_its_own() -> None:
    received: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, _: received.append(number))
    try:
        base = Base(signal.SIGTERM)
        with deploy(robot(base)) as deployed:
            assert deployed.run().problem is None
    finally:
        signal.signal(signal.SIGTERM, before)
    assert received == [signal.SIGTERM]


def test_another_cancellation_is_no_signal() -> None:
    async def main() -> None:
        running = asyncio.ensure_future(deployed.executive.execute("go"))
        await asyncio.sleep(0)
        running.cancel()
        await running

    with deploy(robot(Base())) as deployed, pytest.raises(asyncio.CancelledError):
        run_real(main())


TWICE = """
import signal, sys
from dsc.sequencer.clock import run_real
import asyncio
async def main():
    try:
        signal.raise_signal(signal.SIGTERM)
        await asyncio.sleep(9)
    finally:
        signal.raise_signal(signal.SIGTERM)
run_real(main())
"""


def test_a_second_signal_ends_the_program_at_once() -> None:
    ended = subprocess.run([sys.executable, "-c", TWICE], check=False, timeout=30)
    assert ended.returncode == -signal.SIGTERM
