"""A time limit ends the plot's wait; the clean-up that follows is bounded, and what it observes is known (S1.15)."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import plot
from dsc_runs import SCHEMA, Arm, Ran, ran

from dsc import Component, Outcome, SkillCall, query, skill
from dsc.dynamic.library import Library
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.sequencer import Sequencer
from knowledge_base import Delta, InputError, KnowledgeBase, fact

LIMITED = """
    plot: p
    states:
      a: {entry: {trigger: arm.SKILL, within: 3}, on: {ok: e, answered: e, timed_out: b}}
      b: {after: {seconds: 100, to: e}}
      e: {final: true}
"""
THEN = LIMITED.replace(
    "{after: {seconds: 100, to: e}}", "{entry: {trigger: arm.quick, within: LIMIT}, on: {ok: e, timed_out: e}}"
)


class Ok(Outcome): ...


class Answered(Outcome):
    """An answer."""

    value: float


class Tidy(Component):
    """Needs ten seconds to clean up, and observes `p` meanwhile."""

    name = "arm"

    def __init__(self, how: str = "observes") -> None:
        super().__init__()
        self.how = how
        self.log: list[str] = []

    @skill
    async def slow(self, call: SkillCall) -> Ok:
        try:
            await call.clock.sleep(1000)
        except asyncio.CancelledError:
            await asyncio.sleep(10)
            self.log.append(f"clean at {call.clock.now():g}")
            seen = Delta(added=(fact("p"),))
            if self.how == "observes":
                call.observe(seen)
                raise
            if self.how == "ends":
                return Ok(observed=seen)
            raise
        return Ok()

    @query
    async def ask(self) -> Answered:
        try:
            await asyncio.sleep(1000)
        finally:
            await asyncio.sleep(10)
        return Answered(value=1.0)

    @skill
    async def quick(self, call: SkillCall) -> Ok:
        self.log.append(f"quick at {call.clock.now():g}")
        return Ok()


def outcomes(ran: Ran) -> list[tuple[str, float]]:
    return [(one.data["name"], one.t) for one in ran.records if one.type == "event" and one.data["source"] != "timer"]


@pytest.mark.parametrize("name", ["slow", "ask"])
def test_a_clean_up_does_not_delay_the_end_of_the_wait(name: str) -> None:
    ran = Ran(LIMITED.replace("SKILL", name), arm=Tidy("raises"))
    assert outcomes(ran) == [("timed_out", 3.0)]
    assert (ran.end.finished, ran.at) == (True, 103)


@pytest.mark.parametrize("how", ["observes", "ends"])
@pytest.mark.parametrize("text", [LIMITED, LIMITED.replace("within: 3}", "within: 50}, after: {seconds: 3, to: b}")])
def test_an_observation_of_the_clean_up_is_known_from_then_on(text: str, how: str) -> None:
    ran = Ran(text.replace("SKILL", "slow"), arm=Tidy(how))
    (changed,) = [one for one in ran.records if one.type == "knowledge"]
    assert (changed.t, changed.data["author"], changed.data["added"]) == (13.0, "arm", [["p"]])
    assert changed.cause is not None


def test_an_observation_after_the_last_state_is_known() -> None:
    ran = Ran(LIMITED.replace("SKILL", "slow").replace("timed_out: b", "timed_out: e"), arm=Tidy())
    assert (ran.end.finished, ran.kb.ask("(p)")) == (True, True)


@pytest.mark.parametrize(("limit", "end"), [(20, "ok"), (5, "timed_out")])
def test_the_next_skill_of_the_component_waits_for_the_clean_up_within_its_own_limit(limit: int, end: str) -> None:
    ran = Ran(THEN.replace("SKILL", "slow").replace("LIMIT", str(limit)), arm=Tidy("raises"))
    assert outcomes(ran)[1:] == [(end, 13.0 if end == "ok" else 8.0)]
    assert ran.arm.log == ["clean at 13", *(["quick at 13"] if end == "ok" else [])]


# -- after the computer slept ------------------------------------------------------------------------------


class SleepyLoop(asyncio.SelectorEventLoop):
    """A loop of real time on a computer that sleeps."""

    slept = 0.0

    def time(self):
        return super().time() + self.slept

    def sleep(self, seconds):
        self.slept += seconds


def ended_after_sleep(state, asleep=10.0):
    """The outcome of a plot whose computer sleeps soon after the start."""

    async def main():
        loop = asyncio.get_running_loop()
        assert isinstance(loop, SleepyLoop)
        knowledge = KnowledgeBase(SCHEMA)
        knowledge.apply(Delta(nodes={"cup1": "item"}), "test")
        sequencer = Sequencer(Library([plot(SLEEPER % state)]), knowledge, [Arm()], LoopClock())
        loop.call_later(0.02, loop.sleep, asleep)
        return await sequencer.run("p")

    with asyncio.Runner(loop_factory=SleepyLoop) as runner:
        return [event.name for event in runner.run(main()).emitted]


SLEEPER = """
    plot: p
    emits: {good: {}, bad: {}}
    states:
      a: %s
      good: {final: true, emit: good}
      bad: {final: true, emit: bad}
"""


@pytest.mark.parametrize(
    "state",
    [
        "{entry: {trigger: arm.grasp, with: {seconds: 4}, within: 5}, on: {grasped: good, timed_out: bad}}",
        "{entry: {trigger: arm.grasp, with: {seconds: 4}}, after: {seconds: 5, to: bad}, on: {grasped: good}}",
    ],
)
def test_an_outcome_that_was_due_before_a_limit_is_received_first(state):
    assert ended_after_sleep(state) == ["good"]


@pytest.mark.parametrize(
    "state",
    [
        "{entry: {trigger: arm.grasp, with: {seconds: 60}, within: 5}, on: {grasped: good, timed_out: bad}}",
        "{entry: {trigger: arm.grasp, with: {seconds: 60}}, after: {seconds: 5, to: bad}, on: {grasped: good}}",
        "{after: [{seconds: 5, to: bad}, {seconds: 6, to: good}]}",
    ],
)
def test_a_limit_that_passed_ends_what_is_not_done(state):
    assert ended_after_sleep(state) == ["bad"]


class Ripe(Outcome): ...


class Oven(Component):
    """Skills that take an hour."""

    name = "oven"

    @skill(within=7200)
    async def bake(self, call: SkillCall) -> Ripe:
        await call.clock.sleep(3600)
        return Ripe()

    @skill
    async def roast(self, call: SkillCall) -> Ripe:
        await call.clock.sleep(3600)
        return Ripe()


@pytest.mark.parametrize(
    ("skill_name", "within", "seconds"),
    [("bake", "", 3600), ("roast", "", 300), ("bake", ", within: 60", 60), ("roast", ", within: 4000", 3600)],
)
def test_the_time_limit_of_a_skill_is_that_of_its_trigger_or_of_its_declaration(skill_name, within, seconds):
    text = "{plot: p, states: {a: {entry: {trigger: oven.SKILL}, on: {ripe: e, timed_out: e}}, e: {final: true}}}"
    end, at = ran(text.replace("SKILL", f"{skill_name}{within}"), Oven())
    assert (end.finished, at) == (True, seconds)


@pytest.mark.parametrize("within", [0, -1, float("inf"), float("nan"), "9", True])
def test_a_time_limit_that_is_not_a_positive_number_is_refused(within):
    with pytest.raises(InputError, match="`within` is a positive number of seconds"):
        skill(within=within)


def test_a_skill_has_a_time_limit_or_none():
    with pytest.raises(InputError, match="not both"):
        skill(within=9, unlimited=True)
