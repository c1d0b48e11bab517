"""Every run of a goal ends: within its limit of run time, and at once if nothing can happen any more."""

from __future__ import annotations

import asyncio
import math

import pytest
from dsc_crashes import copied

from dsc import Component, Event, Outcome, Sequencer, SkillCall, parse_plot, run_simulated, skill
from dsc.trace import Record
from knowledge_base import Delta, InputError, fact
from planning import Robot
from planning.robot.robot import LONGEST_RUN

DOMAIN = """
(define (domain office)
  (:predicates (approved) (signed))
  (:action approve :parameters () :precondition (not (approved)) :effect (approved))
  (:action sign :parameters () :precondition (approved) :effect (signed)))
"""
APPROVE = """
plot: approve
implements: approve
states:
  ask: {entry: {trigger: clerk.approve, within: 400000}, on: {did: done}}
  done: {final: true}
"""
SIGN = APPROVE.replace("approve", "sign")
HEARD = """
plot: approve
implements: approve
receives: {yes: }
effects: assumed
states:
  wait: {on: {yes: done}}
  done: {final: true}
"""
ROUND = """
plot: round
states:
  a: {after: {seconds: 100, to: b}}
  b: {after: {seconds: 100, to: a}}
"""
DAY = 86_400.0


class Did(Outcome): ...


class Clerk(Component):
    """Needs a weekend to approve, and a second to sign."""

    name = "clerk"

    def __init__(self, seconds=3 * DAY):
        super().__init__()
        self.seconds = seconds

    @skill
    async def approve(self, call: SkillCall) -> Did:
        await call.clock.sleep(self.seconds)
        return Did(observed=Delta(added=(fact("approved"),)))

    @skill
    async def sign(self, call: SkillCall) -> Did:
        await call.clock.sleep(1)
        return Did(observed=Delta(added=(fact("signed"),)))


def office(*plots, clerk=None, **how):
    return Robot(
        DOMAIN, [parse_plot(text) for text in plots or (APPROVE, SIGN)], [clerk or Clerk()], **how, clock="simulated"
    )


def test_a_plan_may_wait_over_a_weekend():
    with office() as robot:
        assert robot.achieve("(signed)").reached


def test_a_run_ends_at_its_limit_and_names_it():
    with office() as robot:
        end = robot.achieve("(signed)", until=2 * DAY)
    assert (end.finished, end.problem) == (False, "the run has not ended within 172,800 s of run time (until)")


@pytest.mark.parametrize("until", [None, 5_000.0])
def test_a_plot_that_goes_round_ends_too(until):
    records: list[Record] = []
    with office(APPROVE, SIGN, ROUND) as robot:
        robot.listen(records.append)
        end = robot.run("round", until=until)
    limit = LONGEST_RUN if until is None else until
    assert end.problem == f"the run has not ended within {limit:,.0f} s of run time (until)"
    assert records[-1].t == limit


def test_an_open_ended_run_has_no_limit_of_its_own():
    async def main(robot, **how):
        sequencers: list[Sequencer] = []
        run = asyncio.ensure_future(robot.start("round", open_ended=True, prepare=sequencers.append, **how))
        await asyncio.sleep(2 * LONGEST_RUN)
        ended = run.done()
        run.cancel()
        await asyncio.wait([run])
        return ended

    with office(APPROVE, SIGN, ROUND.replace("100", "50_000".replace("_", ""))) as robot:
        assert not run_simulated(main(robot))
        assert run_simulated(main(robot, until=1_000_000))


def test_a_resumed_run_keeps_its_limit(tmp_path):
    (tmp_path / "alive").mkdir()

    def crash(record):
        if record.type == "plan.ordered":
            copied(tmp_path / "alive", tmp_path / "crashed")

    with office(store=tmp_path / "alive" / "run.kb") as robot:
        robot.listen(crash)
        robot.achieve("(signed)", until=2 * DAY)
    with office(store=tmp_path / "crashed" / "run.kb") as robot:
        assert robot.resume().problem == "the run has not ended within 172,800 s of run time (until)"


@pytest.mark.parametrize("until", [0, -1, math.nan, True, "soon"])
def test_a_limit_is_a_positive_number(until):
    with office() as robot, pytest.raises(InputError, match="`until` is a positive number of seconds"):
        robot.achieve("(signed)", until=until)


def test_a_plan_that_waits_for_what_cannot_come_ends_at_once():
    records: list[Record] = []
    with office(HEARD, SIGN) as robot:
        robot.listen(records.append)
        end = robot.achieve("(signed)")
    assert end.problem == "deadlock: no skill, timer or event is pending"
    assert records[-1].t < 60


def test_a_plan_that_waits_for_an_event_to_come_goes_on():
    with office(HEARD, SIGN) as robot:
        end = robot.achieve("(signed)", prepare=lambda s: s.post(Event("yes"), after=3 * DAY))
    assert end.reached
