"""A signal stops the components of a run: without a store the run ends, with a store it can be resumed."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from dsc import Component, Outcome, SkillCall, parse_plot, skill, takes
from dsc.sequencer.clock import ClockKind, run_real
from knowledge_base import StoreError
from planning import Bundle, deploy
from planning.robot.bringup import resume


@pytest.fixture(autouse=True)
def usual_handlers() -> Iterator[None]:
    """Undo the handlers of a shell that has started the tests in the background, or by `nohup`."""
    before = {number: signal.signal(number, usual) for number, usual in USUAL.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


USUAL: dict[int, Any] = {
    signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL, signal.SIGHUP: signal.SIG_DFL,
}  # fmt: skip
PLOT = parse_plot("""
plot: go
states:
  drive:
    entry: [{set: base.speed, to: 2}, {send: base.release}, {trigger: base.drive}]
    exit: {send: base.brake}
    on: {arrived: over}
  over: {final: true}
""")


SIGNALS = {signal.SIGINT: "the operator", signal.SIGTERM: "SIGTERM", signal.SIGHUP: "SIGHUP"}


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
    async def release(self) -> None:
        self.log.append("release")

    @takes
    async def brake(self) -> None:
        self.log.append("brake")


def robot(base: Base) -> Bundle:
    return Bundle("r", plots=(PLOT,), components=lambda: [base], main="go")


@pytest.mark.parametrize("clock", ["real", "simulated"])
@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_ends_a_run_without_a_store(number: signal.Signals, clock: ClockKind) -> None:
    base = Base(number)
    with deploy(robot(base), clock=clock) as deployed:
        report = deployed.report()
    assert report.problem == f"{SIGNALS[number]} ended the run"
    assert sorted(base.log[3:-1]) == ["brake", "off"]
    assert (base.log[:3], base.log[-1]) == (["speed 2", "release", "on"], "stop")
    assert signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler)


@pytest.mark.parametrize("clock", ["real", "simulated"])
@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_suspends_a_run_with_a_store(tmp_path, number: signal.Signals, clock: ClockKind) -> None:
    base = Base(number)
    with deploy(robot(base), store=tmp_path / "run.kb", clock=clock) as deployed:
        report = deployed.report()
    assert report.problem == f"{SIGNALS[number]} suspended the run, which can be resumed"
    assert sorted(base.log[3:-1]) == ["brake", "off"]
    assert base.log[-1] == "stop"

    again = Base()
    with resume(robot(again), tmp_path / "run.kb") as deployed:
        report = deployed.report()
    assert report.problem is None
    assert again.log == ["speed 2", "release", "on", "off", "brake", "stop"]


LATER = parse_plot("""
plot: go
states:
  ready: {entry: {send: base.release}, after: {seconds: 0.01, to: trip}}
  trip:
    entry: [{set: base.speed, to: 2}, {send: base.release}]
    exit: {send: base.brake}
    states:
      rest: {after: {seconds: 0.01, to: drive}}
      drive: {entry: {trigger: base.drive}, exit: {send: base.brake}, on: {arrived: there}}
      there: {final: true}
    on: {done: over}
  over: {final: true}
""")


def test_a_resume_sends_the_messages_of_the_active_states_again(tmp_path) -> None:
    def bundle(base: Base) -> Bundle:
        return Bundle("r", plots=(LATER,), components=lambda: [base], main="go")

    base = Base(signal.SIGTERM)
    with deploy(bundle(base), store=tmp_path / "run.kb", clock="simulated") as deployed:
        deployed.report()
    assert base.log.count("release") == 2
    again = Base(signal.SIGTERM)
    with resume(bundle(again), tmp_path / "run.kb") as deployed:
        deployed.report()
    assert again.log[:3] == ["speed 2", "release", "on"]
    last = Base()
    with resume(bundle(last), tmp_path / "run.kb") as deployed:
        assert deployed.report().problem is None
    assert last.log == ["speed 2", "release", "on", "off", "brake", "brake", "stop"]


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_ends_a_run_with_a_store_on_request(tmp_path, number: signal.Signals) -> None:
    base = Base(number)
    with deploy(robot(base), store=tmp_path / "run.kb", clock="simulated") as deployed:
        assert deployed.report(on_signal="end").problem == f"{SIGNALS[number]} ended the run"
    assert "brake" in base.log
    with pytest.raises(StoreError), resume(robot(base), tmp_path / "run.kb") as deployed:
        deployed.report()


def test_a_signal_that_the_program_handles_remains_its_own() -> None:
    received: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, _: received.append(number))
    try:
        base = Base(signal.SIGTERM)
        with deploy(robot(base), clock="simulated") as deployed:
            assert deployed.report().problem is None
    finally:
        signal.signal(signal.SIGTERM, before)
    assert received == [signal.SIGTERM]


def test_another_cancellation_is_no_signal() -> None:
    async def main() -> None:
        running = asyncio.ensure_future(deployed.start("go"))
        await asyncio.sleep(0)
        running.cancel()
        await running

    with deploy(robot(Base())) as deployed, pytest.raises(asyncio.CancelledError):
        run_real(main())


TWICE = """
import asyncio, signal
from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, parse_plot, skill
from dsc.sequencer.clock import run_real
from knowledge_base import KnowledgeBase, Schema

class Arrived(Outcome): ...

class Base(Component):
    name = "base"
    @skill
    async def drive(self, call: SkillCall) -> Arrived:
        try:
            signal.raise_signal(signal.NAME)
            await asyncio.sleep(9)
        finally:
            signal.raise_signal(signal.NAME)

usual = signal.default_int_handler if signal.NAME == signal.SIGINT else signal.SIG_DFL
signal.signal(signal.NAME, usual)
plot = parse_plot("{plot: p, states: {a: {entry: {trigger: base.drive}, on: {arrived: e}}, e: {final: true}}}")
async def main():
    await Sequencer(Library([plot]), KnowledgeBase(Schema()), [Base()], LoopClock()).run("p")
run_real(main())
"""


@pytest.mark.parametrize("number", SIGNALS)
def test_a_second_signal_ends_the_program_and_reports_what_is_unfinished(number: signal.Signals) -> None:
    program = TWICE.replace("NAME", number.name)
    ended = subprocess.run([sys.executable, "-c", program], check=False, timeout=30, capture_output=True, text=True)
    assert ended.returncode == -number
    assert ended.stderr.splitlines() == [
        f"{number.name} again: the program ends",
        "unfinished: a cancelled skill of component 'base' has not ended",
        "unfinished: component 'base' was not stopped",
    ]


INTERACTIVE = """
import asyncio, signal, sys
from dsc.sequencer.clock import run_real
sys.ps1 = ">>> "
signal.signal(signal.SIGINT, signal.default_int_handler)
async def main():
    try:
        signal.raise_signal(signal.SIGINT)
        await asyncio.sleep(9)
    finally:
        signal.raise_signal(signal.SIGINT)
try:
    run_real(main())
except KeyboardInterrupt:
    print("goes on")
"""


def test_a_second_ctrl_c_ends_no_interactive_interpreter() -> None:
    ended = subprocess.run([sys.executable, "-c", INTERACTIVE], check=False, timeout=30, capture_output=True, text=True)
    assert ended.stdout == "goes on\n"
