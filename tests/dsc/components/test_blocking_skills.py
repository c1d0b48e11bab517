"""Skills that block, in threads and processes; skills that do not stop."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from dsc_runs import Arm, Ran

from dsc import BlockingCall, blocking
from dsc.calls import SkillCall
from dsc.components.assembly import component_of
from dsc.components.component import Component
from dsc.errors import ProgrammingError, SkillError
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_real, run_simulated
from dsc.skills import skill
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, Fact


class Greeted(Outcome):
    person: str


class Ok(Outcome): ...


class Added(Outcome):
    sum: float


class Half(Outcome): ...


class Pid(Outcome):
    pid: float


class Begun(Outcome):
    n: float


class StubbornBegun(Outcome, event="begun"): ...


class Worker(Arm):
    """Blocks in every way there is."""

    name = "arm"

    def __init__(self):
        super().__init__()
        self.stopped = threading.Event()
        self.release = threading.Event()

    @skill(blocking="thread")
    def add(self, call: BlockingCall[Half], a: float, b: float) -> Added:
        call.report(Half())
        return Added(sum=a + b)

    @skill(blocking="thread")
    def sees_and_breaks(self, call) -> Ok:
        call.observe(Delta(added=(Fact("p"),)))
        raise RuntimeError("the bus is stuck")

    @skill(blocking="thread")
    def dawdles(self, call) -> Ok:
        try:
            while True:
                call.sleep(0.005)
        finally:
            self.stopped.set()

    @skill(blocking="thread")
    def deaf(self, call) -> Ok:
        self.release.wait()
        return Ok()

    @skill(blocking="thread")
    def raises(self, call) -> Ok:
        raise RuntimeError("the bus is stuck")

    @skill
    async def swallows(self, call) -> Ok:
        while True:
            try:
                await asyncio.sleep(1)
            except asyncio.CancelledError:
                self.note("no")


class BrokenText(blocking.StoppedError):
    def __str__(self):
        raise ValueError("no text")


class Far(Component):
    """Skills in processes of their own: must be importable there, hence no Arm."""

    name = "far"

    @skill(blocking="process")
    def whoami(self, call: BlockingCall[Begun], n: int) -> Pid:
        call.report(Begun(n=n))
        return Pid(pid=os.getpid())

    @skill(blocking="process")
    def raises(self, call) -> Ok:
        raise RuntimeError("the bus is stuck")

    @skill(blocking="process")
    def exits(self, call) -> Ok:
        sys.exit("no driver")

    @skill(blocking="process")
    def stops(self, call) -> Ok:
        raise BrokenText

    @skill(blocking="process")
    def dies(self, call) -> Ok:
        os._exit(7)

    @skill(blocking="process")
    def stubborn(self, call: BlockingCall[StubbornBegun]) -> Ok:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        call.report(StubbornBegun())
        time.sleep(3600)
        return Ok()

    @skill(blocking="process")
    def sleeps(self, call) -> Ok:
        time.sleep(3600)
        return Ok()


def execute(component, name, run=run_simulated, seconds=None, cancel_after=None, **arguments):
    """Outcome, reports, and what was given up."""
    reports: list[Outcome] = []
    given_up: list[str] = []

    async def main():
        clock = LoopClock()
        deadline = {} if seconds is None else {"deadline": clock.now() + seconds}
        call = SkillCall("a1.0", clock, reports.append, abandon=given_up.append, **deadline)
        task = asyncio.ensure_future(component.execute(name, call, arguments))
        if cancel_after is not None:
            await asyncio.to_thread(cancel_after)
            task.cancel()
        return await task

    return run(main()), reports, given_up


# -- threads -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", [run_simulated, run_real])
def test_a_blocking_skill_runs_in_a_thread_and_reports(run):
    outcome, reports, given_up = execute(Worker(), "add", run, a=1, b=2)
    assert outcome == Outcome("added", {"sum": 3})
    assert [one.event for one in reports] == ["half"]
    assert not given_up


def test_an_observation_in_a_thread_is_known_even_if_the_skill_fails():
    ran = Ran(
        "{plot: p, states: {a: {entry: {trigger: arm.sees_and_breaks}, on: {ok: e}}, e: {final: true}}}", arm=Worker()
    )
    assert "the bus is stuck" in (ran.end.problem or "")
    assert ran.kb.ask("(p)")


def test_an_exception_in_a_thread_becomes_the_problem_of_the_run():
    ran = Ran("{plot: p, states: {a: {entry: {trigger: arm.raises}, on: {ok: e}}, e: {final: true}}}", arm=Worker())
    assert "the bus is stuck" in (ran.end.problem or "")


@pytest.mark.parametrize("run", [run_simulated, run_real])
def test_a_deadline_reaches_a_thread(run):
    worker = Worker()
    with pytest.raises(blocking.DeadlineError):
        execute(worker, "dawdles", run, seconds=0.05)
    assert worker.stopped.is_set()


def test_a_deadline_is_the_event_timed_out():
    text = "{plot: p, states: {a: {entry: {trigger: arm.dawdles, within: 0.05}, on: {ok: x, timed_out: e}}, x: {}, e: {final: true}}}"
    ran = Ran(text, arm=Worker())
    assert ran.end.finished
    assert ran.end.problem is None


def test_a_cancellation_reaches_a_thread():
    worker = Worker()
    with pytest.raises(asyncio.CancelledError):
        execute(worker, "dawdles", run_real, cancel_after=lambda: None)
    assert worker.stopped.is_set()


def test_a_thread_that_does_not_stop_is_left_alone_and_said(monkeypatch):
    monkeypatch.setattr(blocking, "STOPPING", 0.05)
    worker = Worker()
    text = "{plot: p, states: {a: {entry: {trigger: arm.deaf, within: 0.05}, on: {ok: x, timed_out: e}}, x: {}, e: {final: true}}}"
    ran = Ran(text, arm=worker)
    assert not ran.end.finished
    assert "went on for 0.05 s after it was told to stop" in (ran.end.problem or "")
    worker.release.set()


# -- processes ---------------------------------------------------------------------------------------------


def test_a_blocking_skill_runs_in_a_process_and_reports():
    outcome, reports, _ = execute(Far(), "whoami", n=3)
    assert outcome.attributes["pid"] != os.getpid()
    assert reports == [Outcome("begun", {"n": 3})]


def test_a_skill_in_a_process_has_the_turn_of_its_component_while_another_waits():
    who = "entry: {trigger: far.whoami, with: {n: 1}}"
    regions = ", ".join(
        f"r{n}: {{states: {{a{n}: {{{who}, on: {{pid: e{n}}}}}, e{n}: {{final: true}}}}}}" for n in (1, 2)
    )
    ran = Ran(f"{{plot: p, states: {{s: {{regions: {{{regions}}}, on: {{done: e}}}}, e: {{final: true}}}}}}", arm=Far())
    assert ran.end.finished
    assert [one["action"] for one in ran.of_type("action") if one["action"] in {"wait", "begin"}] == ["wait", "begin"]


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("raises", "RuntimeError: the bus is stuck"),
        ("dies", "exit code 7"),
        ("exits", "SystemExit: no driver"),
        ("stops", "BrokenText"),
    ],
)
def test_a_failure_in_a_process_raises_an_error_with_its_reason(name, why):
    with pytest.raises(SkillError if name == "dies" else ProgrammingError, match=why):
        execute(Far(), name)


def test_a_deadline_ends_a_process():
    with pytest.raises(blocking.DeadlineError):
        execute(Far(), "sleeps", seconds=0.2)


ORPHAN = """
import ctypes, math, time
from dsc import Outcome, SkillCall, component_of, skill
from dsc.sequencer.clock import LoopClock, run_real

class Ok(Outcome): ...

@skill(blocking="process")
def moves(call) -> Ok:
    print("begun", flush=True)
    BLOCKS(3600)
    return Ok()

async def main():
    await component_of("far", moves).execute("moves", SkillCall("a1.0", LoopClock(), print, math.inf), {})

if __name__ == "__main__":
    run_real(main())
"""


@pytest.mark.parametrize("blocks", [
    "time.sleep",
    pytest.param("ctypes.PyDLL(None).sleep", marks=pytest.mark.skipif(sys.platform != "linux", reason="no thread watches")),
])  # fmt: skip
def test_a_process_ends_with_the_program_however_that_dies(tmp_path, blocks):
    program = tmp_path / "orphan.py"
    program.write_text(ORPHAN.replace("BLOCKS", blocks))
    with subprocess.Popen([sys.executable, program], stdout=subprocess.PIPE) as running:
        assert running.stdout.readline() == b"begun\n"
        running.kill()
        # the end of what all of its processes write to
        assert running.communicate(timeout=60) == (b"", None)  # type: ignore[comparison-overlap]


def test_a_process_that_does_not_end_when_it_is_told_to_is_killed_and_nothing_goes_on(monkeypatch):
    monkeypatch.setattr(blocking, "STOPPING", 0.2)
    reports: list[Outcome] = []
    given_up: list[str] = []

    async def main():
        begun = asyncio.Event()

        def report(outcome):
            reports.append(outcome)
            begun.set()

        call = SkillCall("a1.0", LoopClock(), report, abandon=given_up.append)
        task = asyncio.ensure_future(Far().execute("stubborn", call, {}))
        await begun.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    run_real(main())
    assert [one.event for one in reports] == ["begun"]
    assert not given_up


# -- skills that do not stop -------------------------------------------------------------------------------

SWALLOWS = """
    plot: p
    states:
      a: {entry: {trigger: arm.swallows, within: WITHIN}, after: {seconds: 5, to: b}, on: {ok: x, timed_out: b}}
      b: {after: {seconds: 100, to: e}}
      x:
      e: {final: true}
"""


@pytest.mark.parametrize(("within", "left"), [(100, 5), (3, 3)])
def test_a_skill_that_swallows_its_cancellation_holds_nothing_up_and_is_said(within, left):
    ran = Ran(SWALLOWS.replace("WITHIN", str(within)), arm=Worker())
    assert not ran.end.finished
    assert "skill 'arm.swallows' ignored its cancellation for 30 s and was abandoned" in (ran.end.problem or "")
    assert ran.at == pytest.approx(left + 100)


def test_a_skill_that_swallows_its_cancellation_does_not_keep_the_process():
    program = """
import asyncio
from dsc.components.hooks import abandon

async def swallows():
    while True:
        try:
            await asyncio.sleep(3600)
        except asyncio.CancelledError:
            pass

async def main():
    task = asyncio.ensure_future(swallows())
    await asyncio.sleep(0)
    task.cancel()
    await asyncio.sleep(0)
    abandon(task)

asyncio.run(main())
print("over")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "over\n"


# -- functions ---------------------------------------------------------------------------------------------


@skill
async def greet(call, person, times: int = 1) -> Greeted:
    return Greeted(person=person * times)


@skill(blocking="thread")
def waits(call) -> Ok:
    return Ok()


def test_a_skill_may_be_a_function():
    voice = component_of("voice", greet, waits)
    signature = voice.skills()["greet"]
    assert (signature.component, signature.parameters) == ("voice", {"person": None, "times": "integer"})
    outcome, _, _ = execute(voice, "greet", person="bob", times=2)
    assert outcome.attributes == {"person": "bobbob"}
    assert execute(voice, "waits")[0].event == "ok"


def test_a_function_that_is_no_skill_is_refused():
    async def plain(call):
        return None

    with pytest.raises(InputError, match="'plain' is not a skill: decorate a function with `skill`"):
        component_of("voice", plain)
