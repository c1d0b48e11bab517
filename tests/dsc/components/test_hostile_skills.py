"""Each end of a skill's task is one answer, however hostile its body; and no hook of a component ends the program."""

from __future__ import annotations

import asyncio
import re
import signal
import sys
import time
from pathlib import Path

import pytest
from dsc_charts import plot
from dsc_runs import SCHEMA, Ran

from dsc.blocking import StoppedError
from dsc.components.behaviour_trees import action, condition, sequence, tree_skill
from dsc.components.component import Component
from dsc.components.ports import takes
from dsc.dynamic.library import Library
from dsc.errors import SkillError
from dsc.events import Event
from dsc.outcomes import Outcome
from dsc.sequencer import dispatcher, message_checks, running_skills
from dsc.sequencer.clock import LoopClock, run_real, run_simulated
from dsc.sequencer.plot_skill import PlotComponent
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase

ANSWERS = """
    plot: p
    variables: {why: text}
    emits: {because: {why: text}, late: {}}
    states:
      a:
        entry: {trigger: arm.SKILL, within: 100}
        on: {ok: e, programming_error: {to: f, assign: {why: ?event.reason}}, timed_out: l}
      e: {final: true}
      f: {final: true, emit: because, with: {why: ?why}}
      l: {final: true, emit: late}
"""


class NoTextError(Exception):
    def __str__(self):
        raise ValueError("no text")

    __repr__ = __str__


class Meta(type):
    @property
    def __name__(cls):  # type: ignore[override]
        raise RuntimeError("no name")


class Nameless(BaseException, metaclass=Meta):
    @property  # type: ignore[misc]
    def __class__(self):
        raise RuntimeError("no class")


class Garbage:  # noqa: PLW1641  # it has a hash that fails
    @property  # type: ignore[misc]
    def __class__(self):
        raise RuntimeError("no class")

    def __eq__(self, other):
        raise RuntimeError("no equality")

    __hash__ = __repr__ = __bool__ = __str__ = __eq__  # type: ignore[assignment]


class Unequal(str):
    def __eq__(self, other):
        raise RuntimeError("no equality")

    def __hash__(self):
        raise RuntimeError("no hash")


RAISED = {
    "no text": NoTextError,
    "no name": Nameless,
    "exit": lambda: SystemExit("the driver"),
    "closes": GeneratorExit,
    "interrupts": KeyboardInterrupt,
    "stops": StopIteration,
    "stops asynchronously": StopAsyncIteration,
    "stopped": StoppedError,
    "base": lambda: BaseException("so"),
    "group": lambda: BaseExceptionGroup("g", [NoTextError(), SystemExit(3)]),
    "surrogates": lambda: RuntimeError("\ud800\x1b[31m" * 10_000),
}
RETURNED = {
    "garbage": Garbage,
    "garbage as event": lambda: Outcome(Garbage()),  # type: ignore[arg-type]
    "odd event": lambda: Outcome(Unequal("ok"), {Unequal("a"): 1}),
    "event of no text": lambda: Outcome(["ok"]),  # type: ignore[arg-type]
    "garbage as attributes": lambda: Outcome("ok", Garbage()),  # type: ignore[arg-type]
    "garbage as value": lambda: Outcome("ok", {"a": Garbage()}),
    "garbage as observation": lambda: Outcome("ok", observed=Garbage()),  # type: ignore[arg-type]
    "garbage observed": lambda: Outcome("ok", observed=Delta(added=(fact("p", Garbage()),))),  # type: ignore[arg-type]
    "unhashable observed": lambda: Outcome("ok", observed=Delta(added=(fact("p", []),))),  # type: ignore[arg-type]
    "nothing": lambda: None,
}


class Ok(Outcome): ...


class No(Outcome): ...


class Hostile(Component):
    """Does what it is made for, in a coroutine, a thread, a behaviour tree, or while it is told something."""

    name = "arm"

    def __init__(self, does):
        super().__init__()
        self.does = does

    @skill
    async def awaited(self, call) -> Ok:
        return self.does()  # type: ignore[no-any-return]

    @skill
    async def later(self, call) -> Ok:
        await call.clock.sleep(1)
        return self.does()  # type: ignore[no-any-return]

    @skill(blocking="thread")
    def in_thread(self, call) -> Ok:
        return self.does()  # type: ignore[no-any-return]

    @skill
    async def while_cancelled(self, call) -> Ok:  # type: ignore[return]
        try:
            await call.clock.sleep(1000)
        except asyncio.CancelledError:
            return self.does()  # type: ignore[no-any-return]

    @tree_skill(success=Ok, failure=No)
    def tree(self, call):
        async def act():
            return self.does()

        return sequence(action("act", act, {"ok"}))

    @tree_skill(success=Ok, failure=No)
    def tests(self, call):
        return sequence(condition("test", self.does))

    @skill
    async def goes(self, call) -> Ok:
        return Ok()

    @skill
    async def reports(self, call) -> Ok:
        call.report(self.does())
        await call.clock.sleep(1)
        return Ok()

    @skill(blocking="thread")
    def reports_from_thread(self, call) -> Ok:
        call.report(self.does())
        return Ok()

    @takes
    async def told(self):
        self.does()


def raising(make):
    def does():
        raise make()

    return does


def answers(ran):
    names = {"ok", "programming_error", "timed_out"}
    return [event for event in ran.of_type("event") if event["name"] in names and "of" not in event]


PLACE = re.compile(r" \(\S+:[0-9]+\)$")
"""File and line at the end of a reason."""


@pytest.mark.parametrize("where", ["awaited", "later", "in_thread", "tree", "tests"])
@pytest.mark.parametrize("kind", RAISED)
def test_any_exception_in_a_skill_is_one_programming_error(kind, where):
    ran = Ran(ANSWERS.replace("SKILL", where), arm=Hostile(raising(RAISED[kind])))
    (event,) = answers(ran)
    assert event["name"] == "programming_error"
    assert event["attributes"]["reason"].isprintable()
    assert len(PLACE.sub("", event["attributes"]["reason"])) < 500
    assert ran.at < 2


@pytest.mark.parametrize("where", ["awaited", "in_thread", "reports", "reports_from_thread"])
@pytest.mark.parametrize("kind", RETURNED)
def test_an_impossible_outcome_or_report_is_one_programming_error(kind, where):
    ran = Ran(ANSWERS.replace("SKILL", where), arm=Hostile(RETURNED[kind]))
    (event,) = answers(ran)
    assert event["name"] == ("ok" if kind == "odd event" and event["name"] == "ok" else "programming_error")
    assert ran.at < 2


@pytest.mark.parametrize("kind", RAISED)
def test_an_exception_while_a_component_takes_a_message_fails_the_next_skill(kind):
    text = ANSWERS.replace("{trigger: arm.SKILL, within: 100}", "[{send: arm.told}, {trigger: arm.goes, within: 100}]")
    ran = Ran(text, arm=Hostile(raising(RAISED[kind])))
    assert [event["name"] for event in answers(ran)] == ["programming_error"]


@pytest.mark.parametrize("kind", RAISED)
def test_a_programming_error_in_the_clean_up_after_the_time_limit_is_in_the_end(kind):
    ran = Ran(ANSWERS.replace("SKILL", "while_cancelled"), arm=Hostile(raising(RAISED[kind])))
    assert [event["name"] for event in answers(ran)] == ["timed_out"]
    assert "arm.while_cancelled: " in (ran.end.programming_error or "")
    assert ran.at == 100


@pytest.mark.parametrize("error", [SkillError("no power"), TimeoutError("no answer")])
def test_a_device_that_fails_at_the_time_limit_has_timed_out(error):
    ran = Ran(ANSWERS.replace("SKILL", "while_cancelled"), arm=Hostile(raising(lambda: error)))
    assert [event["name"] for event in answers(ran)] == ["timed_out"]
    assert ran.at == 100


def test_an_answer_after_the_time_limit_is_none_but_what_it_observed_is_known():
    seen = Outcome("ok", observed=Delta(added=(fact("p"),)))
    ran = Ran(ANSWERS.replace("SKILL", "while_cancelled"), arm=Hostile(lambda: seen))
    assert [event["name"] for event in answers(ran)] == ["timed_out"]
    assert ran.kb.ask("(p)")


def test_a_task_that_others_cancel_is_a_programming_error():
    def cancel_all():
        for task in asyncio.all_tasks():
            if "_execute" in repr(task):
                task.cancel()
        return Outcome("ok")

    def cancel_soon(sequencer):
        sequencer.listen(lambda _: asyncio.get_running_loop().call_soon(cancel_all))

    class Cancels(Hostile):
        @skill
        async def itself(self, call) -> Ok:
            asyncio.current_task().cancel()
            await call.clock.sleep(1)
            return Ok()

    for where in ("itself", "goes"):
        arm = Cancels(cancel_all)
        ran = Ran(ANSWERS.replace("SKILL", where), arm=arm, prepare=cancel_soon if where == "goes" else None)
        (event,) = answers(ran)
        assert event["name"] == "programming_error"
        assert "cancelled" in event["attributes"]["reason"]


@pytest.mark.parametrize("broken_part", ["validated", "faulty"])
def test_the_time_limit_holds_even_if_the_handler_of_ends_fails(broken_part, monkeypatch):
    def fails(*_):
        raise RuntimeError("a fault of our own")

    for module in (dispatcher, running_skills, message_checks):
        monkeypatch.setattr(module, broken_part, fails, raising=module is not dispatcher)
    ran = Ran(
        ANSWERS.replace("SKILL", "awaited"),
        arm=Hostile(raising(NoTextError) if broken_part == "faulty" else lambda: Outcome("ok")),
    )
    (event,) = answers(ran)
    assert event["name"] == ("timed_out" if broken_part == "faulty" else "programming_error")
    assert ran.at == (100 if broken_part == "faulty" else 0)


def test_ctrl_c_ends_the_program():
    def press():
        signal.raise_signal(signal.SIGINT)
        return Outcome("ok")

    with pytest.raises(KeyboardInterrupt):
        Ran(ANSWERS.replace("SKILL", "later"), arm=Hostile(press))


def test_ctrl_c_ends_a_program_whose_loop_has_no_handler_of_its_own():
    async def main():
        clock = LoopClock()
        library = Library([plot(ANSWERS.replace("SKILL", "awaited"))])
        arm = Hostile(lambda: signal.raise_signal(signal.SIGINT))
        await Sequencer(library, KnowledgeBase(SCHEMA), [arm], clock).run("p")

    loop = asyncio.new_event_loop()
    running = loop.create_task(main())
    with pytest.raises(KeyboardInterrupt):
        loop.run_until_complete(running)
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        loop.run_until_complete(running)
    loop.close()


@pytest.mark.parametrize("kind", RAISED)
def test_a_plot_as_a_skill_says_what_failed_in_it(kind):
    inner = plot("{plot: inner, states: {a: {entry: {trigger: arm.awaited}, on: {ok: e}}, e: {final: true}}}")
    outer = PlotComponent("arm", Library([inner]), [Hostile(raising(RAISED[kind]))])
    ran = Ran(ANSWERS.replace("arm.SKILL", "arm.inner").replace("ok: e", "completed: e"), arm=outer)
    (event,) = answers(ran)
    assert event["name"] == "programming_error"
    assert "arm.awaited" in event["attributes"]["reason"]


# -- hooks -------------------------------------------------------------------------------------------------

EXITS = {kind: RAISED[kind] for kind in ("no text", "no name", "exit", "closes", "interrupts", "base")} | {
    "cancels itself": asyncio.CancelledError,
}
USES = """
    plot: p
    states:
      a:
        entry: [{set: arm.speed, to: 1}, {trigger: arm.goes, within: 100}]
        exit: {switch: arm, to: shutdown}
        on: {ok: e, programming_error: f, timed_out: f}
      e: {final: true}
      f: {final: true}
"""


class Hooked(Hostile):
    """A component one of whose hooks raises."""

    def __init__(self, hook, make):
        super().__init__(lambda: None)
        self.hook = hook
        self.make = make
        self.called = []

    def run(self, hook):
        self.called.append(hook)
        if hook == self.hook:
            raise self.make()

    async def start(self):
        self.run("start")

    async def stop(self):
        self.run("stop")

    async def activate(self, active):
        self.run("activate" if active else "deactivate")

    async def configure(self, parameter, value):
        self.run("configure")

    async def forget(self, action_id):
        self.run("forget")


@pytest.mark.parametrize("kind", EXITS)
@pytest.mark.parametrize("hook", ["start", "stop", "activate", "deactivate", "configure", "forget"])
def test_a_hook_that_exits_fails_and_the_run_goes_on(hook, kind):
    arm = Hooked(hook, EXITS[kind])
    ran = Ran(USES, arm=arm)
    assert hook in arm.called
    assert ran.end.finished == (hook not in {"stop", "deactivate"})
    failed = [event["name"] for event in ran.of_type("event")]
    assert failed == (["programming_error"] if hook in {"start", "activate", "configure"} else ["ok"])
    assert ("switch arm to 'shutdown': arm." in (ran.end.problem or "")) == (hook in {"stop", "deactivate"})


class Needy(Hooked):
    """A component whose needs cannot be read."""

    name = "needy"

    def needed(self):
        raise self.make()


@pytest.mark.parametrize("kind", EXITS)
def test_needs_that_cannot_be_read_fail_the_skills_of_their_component_only(kind):
    reasons: list[Event] = []

    def prepare(sequencer):
        sequencer.dispatcher.deploy(Needy("none", EXITS[kind]))
        sequencer.listen(lambda step: reasons.extend(m.event for m in step.microsteps if m.event))

    both = """
        plot: p
        states:
          a: {entry: [{trigger: needy.goes, within: 100}, {trigger: arm.goes, within: 100}], on: {programming_error: {}, ok: e}}
          e: {final: true}
    """
    ran = Ran(both, arm=Hooked("none", EXITS[kind]), prepare=prepare)
    assert (ran.end.finished, ran.end.problem) == (True, None)
    failed, ok = reasons
    assert ok.name == "ok"
    assert failed.attributes["skill"] == "needy.goes"
    assert failed.attributes["reason"].startswith("needy.needed: ")
    assert ran.end.programming_error is None  # the plot has handled it


@pytest.mark.parametrize("where", ["listener", "subscriber"])
def test_an_observer_that_exits_stops_no_robot_and_is_in_the_end_of_the_run(where, caplog):
    def exits(_):
        sys.exit("the window")

    def prepare(sequencer):
        if where == "listener":
            sequencer.listen(exits)
        else:
            sequencer.knowledge.subscribe(exits)

    arm = Hostile(lambda: Outcome("ok", observed=Delta(added=(fact("p"),))))
    end = Ran(ANSWERS.replace("SKILL", "awaited"), arm=arm, prepare=prepare).end
    assert (end.finished, end.problem) == (True, None)
    assert "the window" in str(end.programming_error)
    assert f"{Path(__file__).name}:" in str(end.programming_error)
    assert "Traceback" in caplog.text


# -- late --------------------------------------------------------------------------------------------------

SHORT = ANSWERS.replace("within: 100", "within: 0.02")


@pytest.mark.parametrize(("run", "ends"), [(run_real, "timed_out"), (run_simulated, "ok")])
def test_a_skill_that_blocked_the_loop_past_its_limit_has_timed_out_in_real_time(run, ends):
    def blocks():
        time.sleep(0.05)
        return Outcome("ok")

    heard: list[str] = []

    async def main():
        clock = LoopClock()
        sequencer = Sequencer(
            Library([plot(SHORT.replace("SKILL", "awaited"))]), KnowledgeBase(SCHEMA), [Hostile(blocks)], clock
        )
        sequencer.listen(lambda step: heard.extend(micro.event.name for micro in step.microsteps if micro.event))
        await sequencer.run("p")

    run(main())
    assert heard == [ends]
