"""Errors that Python would only print: coroutines and tasks that nobody awaits, and reports from other threads."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import pytest

from dsc import Component, Library, Outcome, Sequencer, SkillCall, parse_plot, skill
from dsc.sequencer.clock import LoopClock, run_simulated
from knowledge_base import Delta, KnowledgeBase, fact
from knowledge_base.world.schema import Schema


class Did(Outcome): ...


class Arm(Component):
    @skill
    async def forgets_to_await(self, call: SkillCall) -> Did:
        call.clock.sleep(2)  # type: ignore[unused-coroutine]  # the planted mistake
        return Did()

    @skill
    async def loses_a_task(self, call: SkillCall) -> Did:
        async def work():
            raise KeyError("voice")

        asyncio.create_task(work())  # noqa: RUF006  # the planted mistake
        await call.clock.sleep(2)
        return Did()

    @skill
    async def observes_in_a_thread(self, call: SkillCall) -> Did:
        thread = threading.Thread(target=self.observe_and_keep_the_error, args=(call,))
        thread.start()
        thread.join()
        await call.clock.sleep(2)
        return Did()

    def observe_and_keep_the_error(self, call):
        try:
            call.observe(Delta(added=(fact("lit"),)))
        except Exception as error:  # noqa: BLE001
            self.error = error

    @skill
    async def waits_for_a_thread(self, call: SkillCall) -> Did:
        await asyncio.to_thread(time.sleep, 0.05)
        return Did()

    @skill
    async def polls(self, call: SkillCall) -> Did:
        while True:
            try:
                await call.clock.sleep(0.1)
            except:  # noqa: E722, S112  # the planted mistake
                continue


def ended(name):
    text = f"{{plot: p, states: {{a: {{entry: {{trigger: arm.{name}, within: 60}}, on: {{did: e}}}}, e: {{final: true}}}}}}"
    knowledge = KnowledgeBase(Schema.parse("(define (domain d) (:predicates (lit)))"))

    async def main():
        return await Sequencer(Library([parse_plot(text)]), knowledge, [Arm()], LoopClock()).run("p")

    return run_simulated(main())


def line_of(text):
    return next(n for n, line in enumerate(Path(__file__).read_text().splitlines(), start=1) if text in line)


@pytest.mark.parametrize(
    ("name", "said", "line"),
    [
        ("forgets_to_await", "coroutine 'LoopClock.sleep' was never awaited; write `await` before it", "call.clock.sleep(2)  #"),
        ("loses_a_task", "a task that nobody awaits: KeyError: 'voice'", 'raise KeyError("voice")'),
    ],
)  # fmt: skip
def test_an_unawaited_coroutine_or_task_is_a_programming_error_of_the_run(name, said, line):
    assert ended(name).programming_error == f"{said} ({__file__}:{line_of(line)})"


def test_a_report_from_another_thread_is_a_programming_error():
    end = ended("observes_in_a_thread")
    assert not end.finished
    assert end.programming_error == "arm.observes_in_a_thread: it reports from another thread; declare it `blocking`"


def test_simulated_time_waits_for_a_thread_of_asyncio():
    assert ended("waits_for_a_thread").finished


def test_a_late_skill_says_where_it_waited():
    place = f"{__file__}:{line_of('await call.clock.sleep(0.1)')}"
    assert f"arm.polls: no outcome within 60 s, it waited at {place}" in str(ended("polls").problem)


def test_a_skill_that_ignores_its_end_does_not_keep_the_program_alive():
    code = "import test_unheard_errors; print(test_unheard_errors.ended('polls').finished)"
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=30)  # noqa: PLW1510
    assert done.stdout == "False\n", done.stderr


def test_a_run_leaves_the_warnings_of_the_program_alone():
    shown, filters = warnings.showwarning, [*warnings.filters]
    ended("forgets_to_await")
    assert (warnings.showwarning, warnings.filters) == (shown, filters)


def test_a_run_in_real_time_shows_the_warning_as_python_does(recwarn):
    knowledge = KnowledgeBase(Schema.parse("(define (domain d) (:predicates (lit)))"))
    text = (
        "{plot: p, states: {a: {entry: {trigger: arm.forgets_to_await, within: 60}, on: {did: e}}, e: {final: true}}}"
    )

    async def main():
        shown = warnings.showwarning
        end = await Sequencer(Library([parse_plot(text)]), knowledge, [Arm()], LoopClock()).run("p")
        return end, warnings.showwarning is shown

    end, untouched = asyncio.run(main())
    assert (end.finished, untouched) == (True, True)
    assert [str(one.message) for one in recwarn] == ["coroutine 'LoopClock.sleep' was never awaited"]
