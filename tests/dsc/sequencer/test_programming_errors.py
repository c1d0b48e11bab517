"""A bug in a user's code ends the run with file and line, and nothing answers it that does not name it."""

from __future__ import annotations

import logging
import re
import threading
import time
from typing import Never

import pytest
from dsc_runs import SCHEMA, Ran

from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.errors import SkillError
from dsc.outcomes import Outcome
from dsc.sequencer import watchdog
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.text.plot_files import parse_plot
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base import KnowledgeBase, computed
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, fact

HERE = "test_programming_errors.py"


class Grasped(Outcome): ...


class Slipped(Outcome): ...


class Arm(Component):
    """A component with bugs in its skill, its hooks, or both."""

    name = "arm"
    device_errors = (ConnectionError,)

    def __init__(self, raises=None, where="grasp"):
        super().__init__()
        self.raises, self.where, self.called = raises or AttributeError("'Arm' has no gripper"), where, []

    def pass_by(self, hook):
        self.called.append(hook)
        if hook == self.where:
            raise self.raises

    @skill
    async def grasp(self, call) -> Grasped | Slipped:
        try:
            await call.clock.sleep(1)
        finally:
            self.pass_by("clean up")
        self.pass_by("grasp")
        return Grasped()

    @skill(blocking="thread")
    def grasp_in_thread(self, call) -> Grasped:
        self.pass_by("grasp_in_thread")
        return Grasped()

    async def start(self):
        self.pass_by("start")

    async def stop(self):
        self.pass_by("stop")

    async def activate(self, active):
        self.pass_by("activate" if active else "deactivate")

    async def configure(self, parameter, value):
        self.pass_by("configure")

    async def switch(self, mode):
        self.pass_by("switch")


GRASP = """
    plot: p
    outputs: {n: {type: number, initial: 3}}
    states:
      a: {entry: {trigger: arm.grasp}, exit: {switch: arm, to: shutdown}, on: {grasped: e, slipped: e}}
      e: {final: true}
"""


def test_a_bug_in_a_skill_ends_the_run_with_file_and_line_and_its_traceback_in_the_log(caplog):
    arm = Arm()
    ran = Ran(GRASP, arm=arm)
    assert not ran.end.finished
    assert re.fullmatch(
        rf"arm\.grasp: AttributeError: 'Arm' has no gripper \(.*{HERE}:\d+\)", str(ran.end.programming_error)
    )
    assert ran.end.problem == ran.end.programming_error
    assert ran.end.reason == f"programming error in {ran.end.programming_error}"
    (record,) = [one for one in caplog.records if one.levelno >= logging.ERROR]
    assert record.name.startswith("dsc.")
    _, head, first, *_ = record.getMessage().splitlines()
    assert head.startswith("Traceback")
    assert HERE in first  # without the calls that led to the user's code
    assert "self.pass_by" in record.getMessage()
    assert "stop" in arm.called  # exit actions are carried out


@pytest.mark.parametrize("where", ["start", "activate", "configure", "switch", "grasp_in_thread"])
def test_a_bug_in_a_hook_or_a_thread_ends_the_run(where):
    text = GRASP.replace(
        "{trigger: arm.grasp}", "[{set: arm.speed, to: 1}, {switch: arm, to: fast}, {trigger: arm.SKILL}]"
    )
    text = text.replace("SKILL", where if where == "grasp_in_thread" else "grasp")
    end = Ran(text, arm=Arm(where=where)).end
    assert not end.finished
    assert str(end.programming_error).startswith(f"arm.{where}: AttributeError")
    assert HERE in str(end.programming_error)


@pytest.mark.parametrize("where", ["stop", "deactivate"])
def test_a_bug_at_the_end_of_a_run_is_in_its_end(where):
    end = Ran(GRASP, arm=Arm(where=where)).end
    assert not end.finished
    hook = "stop" if where == "stop" else "activate"
    assert str(end.programming_error).startswith(f"arm.{hook}: AttributeError")


def test_a_bug_in_the_clean_up_of_a_cancelled_skill_ends_the_run():
    text = """
        plot: p
        states:
          a: {entry: {trigger: arm.grasp}, after: {seconds: 0.5, to: b}}
          b: {after: {seconds: 100, to: e}}
          e: {final: true}
    """
    ran = Ran(text, arm=Arm(where="clean up"))
    assert str(ran.end.programming_error).startswith("arm.grasp: AttributeError")
    assert ran.at < 2


@pytest.mark.parametrize("error", [ConnectionError("gone"), ConnectionResetError("reset"), SkillError("no power")])
@pytest.mark.parametrize("where", ["grasp", "start", "configure"])
def test_a_declared_failure_of_a_device_is_no_bug(error, where, caplog):
    text = GRASP.replace("{trigger: arm.grasp}", "[{set: arm.speed, to: 1}, {trigger: arm.grasp}]")
    end = Ran(text.replace("on: {", "on: {skill_error: e, "), arm=Arm(error, where)).end
    assert (end.finished, end.programming_error) == (True, None)
    assert end.outputs == {"n": 3}
    assert not [one for one in caplog.records if one.levelno >= logging.ERROR]


@pytest.mark.parametrize("named", [False, True])
def test_only_who_names_a_bug_responds_to_it(named):
    text = GRASP.replace("on: {", "on: {programming_error: e, " if named else "on: {skill_error: e, timed_out: e, ")
    end = Ran(text, arm=Arm()).end
    assert end.finished is named
    assert (end.programming_error is None) is named


def test_a_rule_answers_a_bug_only_by_its_name():
    step = """
        plot: p
        states:
          a: {use: inner, on: {done: e}}
          e: {final: true}
        rules:
          - {on: EVENT, do: {then: retry, limit: 2}}
    """
    inner = parse_plot("{plot: inner, states: {a: {entry: {trigger: arm.grasp}, on: {grasped: e}}, e: {final: true}}}")
    for event, tries in (("skill_error", 1), ("programming_error", 3)):
        arm = Arm()
        library = Library([parse_plot(step.replace("EVENT", event)), inner])

        async def main(library=library, arm=arm):
            return await Sequencer(library, KnowledgeBase(SCHEMA), [arm], LoopClock()).run("p")

        end = run_simulated(main())
        assert arm.called.count("grasp") == tries
        assert "arm.grasp: AttributeError" in str(end.programming_error)


@pytest.mark.parametrize("observed", [Delta(added=(fact("nonsense", "x"),)), Delta(added=(fact("seen", "ghost"),))])
def test_an_observation_that_no_world_can_have_is_a_bug_at_the_line_of_its_skill(observed):
    class Dreams(Arm):
        @skill
        async def grasp(self, call) -> Grasped:
            return Grasped(observed=observed)

    end = Ran(GRASP.replace(", slipped: e", ""), arm=Dreams(where="")).end
    assert str(end.programming_error).startswith("arm.grasp: ")
    assert re.search(rf"{HERE}:\d+\)", str(end.programming_error))


def test_an_observation_of_an_object_that_another_part_has_deleted_is_no_bug():
    class Late(Arm):
        @skill
        async def grasp(self, call) -> Grasped:
            await call.clock.sleep(5)
            return Grasped(observed=Delta(added=(fact("seen", "cup1"),)))

    def prepare(sequencer):
        sequencer.change(Delta(removed_nodes=("cup1",)), "operator", after=1)

    text = GRASP.replace("on: {", "on: {skill_error: e, ")
    end = Ran(text, arm=Late(where=""), things=["cup1"], prepare=prepare).end
    assert (end.finished, end.programming_error) == (True, None)


def test_a_bug_in_a_computed_predicate_has_its_file_and_line(caplog):
    @computed("(heavy ?i - item)", reads=["(seen ?i)"])
    def heavy(seen):
        return seen.weight > 3

    text = """
        plot: p
        states:
          a: {always: {when: (heavy cup1), to: e}, on: HANDLER}
          e: {final: true}
    """
    for handler, finished in (("{error: e}", False), ("{programming_error: e}", True)):
        kb = KnowledgeBase(SCHEMA.with_computed(heavy))
        kb.apply(Delta(nodes={"cup1": "item"}), "test")
        library = Library([parse_plot(text.replace("HANDLER", handler))])

        async def main(library=library, kb=kb):
            return await Sequencer(library, kb, [], LoopClock()).run("p")

        end = run_simulated(main())
        assert end.finished is finished
        assert (end.programming_error is None) is finished
    assert re.search(rf"AttributeError: .*{HERE}:\d+", caplog.text)


def test_a_bug_at_a_host_ends_the_run_of_its_client(caplog):
    async def main(where):
        transport = LocalTransport()
        host = Host(Arm(where=where), transport, LoopClock())
        remote = await RemoteComponent.connect("arm", transport)
        library = Library([parse_plot(GRASP.replace("on: {", "on: {skill_error: e, "))])
        end = await Sequencer(library, KnowledgeBase(SCHEMA), [remote], LoopClock()).run("p")
        await host.close()
        return end

    for where in ("grasp", "start", "activate"):
        end = run_simulated(main(where))
        assert str(end.programming_error).startswith(f"arm.{where}: AttributeError"), where
        assert HERE in str(end.programming_error)
    assert "Traceback" in caplog.text


def test_the_needs_of_a_hosted_component_that_cannot_be_read_fail_it_with_the_reason(caplog):
    class Needy(Arm):
        def needed(self):
            raise AttributeError("no needs")

    async def main():
        transport = LocalTransport()
        arm = Needy(where="")
        host = Host(arm, transport, LoopClock())
        remote = await RemoteComponent.connect("arm", transport)
        end = await Sequencer(Library([parse_plot(GRASP)]), KnowledgeBase(SCHEMA), [remote], LoopClock()).run("p")
        await host.close()
        return end

    end = run_simulated(main())
    assert "arm.needed: AttributeError: no needs" in str(end.programming_error)


def test_an_invalid_list_of_device_errors_is_refused_when_the_class_is_made():
    with pytest.raises(InputError, match=r"`device_errors` of .*Wrong is a tuple of exception classes, as in"):

        class Wrong(Component):
            device_errors = OSError  # type: ignore[assignment]


def test_a_trace_listener_with_a_bug_is_not_called_again_and_the_end_says_so(caplog):
    calls = []

    def listener(record):
        calls.append(record)
        raise KeyError("nobody")

    ran = Ran(GRASP, arm=Arm(where=""), prepare=lambda sequencer: sequencer.trace.listen(listener))
    assert ran.end.finished
    assert len(calls) == 1
    assert str(ran.end.programming_error).startswith("a listener of the trace: KeyError: 'nobody'")


# -- the watchdog ------------------------------------------------------------------------------------------


class Warned(logging.Handler):
    """Sets an event at the first record of a logger."""

    def __init__(self):
        super().__init__()
        self.event = threading.Event()

    def emit(self, record):
        self.event.set()


@pytest.fixture
def warned(monkeypatch):
    monkeypatch.setattr(watchdog, "BLOCKED", 0.05)
    handler = Warned()
    logging.getLogger("dsc.sequencer").addHandler(handler)
    yield handler.event
    logging.getLogger("dsc.sequencer").removeHandler(handler)


def test_a_skill_that_blocks_the_loop_is_named_with_its_line(warned, caplog):
    class Blocks(Arm):
        @skill
        async def grasp(self, call) -> Grasped:
            assert warned.wait(10)
            return Grasped()

    assert Ran(GRASP.replace(", slipped: e", ""), arm=Blocks(where="")).end.finished
    (said,) = [one.getMessage() for one in caplog.records if "blocks" in one.getMessage()]
    assert re.fullmatch(rf"skill 'arm\.grasp' blocks the event loop for 0\.05 s at .*{HERE}:\d+; declare .*", said)


def test_a_listener_that_blocks_the_loop_is_named_with_its_line(warned, caplog):
    waits = [True]

    def listener(_):
        if waits.pop() if waits else False:
            assert warned.wait(10)

    ran = Ran(GRASP, arm=Arm(where=""), prepare=lambda sequencer: sequencer.listen(listener))
    assert ran.end.finished
    assert re.search(rf"a hook or listener blocks the event loop for 0\.05 s at .*{HERE}:\d+", caplog.text)


def test_a_skill_that_waits_blocks_nothing_and_the_watchdog_ends_with_the_run(warned, caplog):
    class Waits(Arm):
        @skill(blocking="thread")
        def grasp(self, call) -> Grasped:  # type: ignore[override]
            call.stopping.wait(0.2)
            return Grasped()

    before = set(threading.enumerate())  # another test may have abandoned a run with its watchdog
    assert Ran(GRASP.replace(", slipped: e", ""), arm=Waits(where="")).end.finished
    assert "blocks" not in caplog.text
    assert not [one for one in threading.enumerate() if one.name == "watchdog" and one not in before]


def test_code_that_is_not_the_users_is_named_with_its_own_line_and_not_the_users_call_of_the_loop(warned, caplog):
    names: dict[str, object] = {"warned": warned, "waits": [True]}
    library = "def listener(_):\n    if waits and waits.pop(): warned.wait(10)\n"
    exec(compile(library, watchdog.__file__, "exec"), names)  # noqa: S102  # code of an installed package
    Ran(GRASP, arm=Arm(where=""), prepare=lambda sequencer: sequencer.listen(names["listener"]))
    assert re.search(
        r"the executive blocks the event loop for 0\.05 s at .*threading\.py:\d+$", caplog.text, re.MULTILINE
    )


def test_a_skill_that_blocks_again_is_reported_once_with_the_number_of_its_blocks(warned, caplog):
    class Blocks(Arm):
        @skill
        async def grasp(self, call) -> Grasped:
            for _ in range(3):
                time.sleep(0.15)  # noqa: ASYNC251  # it blocks the loop
                await call.clock.sleep(1)
            return Grasped()

    assert Ran(GRASP.replace(", slipped: e", ""), arm=Blocks(where="")).end.finished
    said = [one.getMessage() for one in caplog.records if "block" in one.getMessage()]
    assert len(said) == 2
    assert re.fullmatch(
        r"skill 'arm\.grasp' in grasp \(.*\) has blocked the event loop 3 times, 0\.\d s in all", said[1]
    )


def raise_itself() -> Never:
    error = ValueError("no gripper")
    raise error from error


def test_an_error_that_is_its_own_cause_ends_the_run_with_its_line():
    class Endless(Arm):
        @skill
        async def grasp(self, call) -> Grasped:
            return raise_itself()

    end = Ran(GRASP, arm=Endless()).end
    assert re.fullmatch(rf"arm\.grasp: ValueError: no gripper \(.*{HERE}:\d+\)", str(end.programming_error))
