"""A short outage of a device uses up no goal: the escalation waits for it, with longer and longer pauses (S4.2)."""

from __future__ import annotations

import pytest

from dsc import Component, Life, LoopClock, Outcome, SkillCall, parse_plot, skill
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """
(define (domain rover)
  (:types place)
  (:predicates (visited ?p - place))
  (:action visit :parameters (?p - place) :precondition (not (visited ?p)) :effect (visited ?p)))
"""
VISIT = """
plot: visit
implements: visit
parameters: {p: place}
states:
  go: {entry: {trigger: base.visit, with: {p: ?p}}, on: {visited: there}}
  there: {final: true}
"""


class Visited(Outcome): ...


class Base(Component):
    """A device that is away between two moments; its hooks fail, or only its skills do."""

    name = "base"
    device_errors = (OSError,)

    def __init__(self, since, until, *, lost=True):
        super().__init__()
        self.since, self.until, self.lost = since, until, lost
        self.clock: LoopClock | None = None
        self.begun: list[float] = []

    def away(self):
        assert self.clock is not None
        return self.since <= self.clock.now() < self.until

    async def start(self):
        self.clock = self.clock or LoopClock()
        if self.lost and self.away():
            raise OSError("no answer")

    @skill
    async def visit(self, call: SkillCall, p: str) -> Visited:
        self.begun.append(call.clock.now())
        for _ in range(50):
            if self.away():
                if self.lost:
                    self.life.become(Life.FATAL_ERROR, "it reboots")
                raise OSError("no answer")
            await call.clock.sleep(0.1)
        return Visited(observed=Delta(added=(fact("visited", p),)))


def visited(base, **how):
    """How the goal to visit three places ended, with the records of the run."""
    records: list[Record] = []
    with Robot(DOMAIN, [parse_plot(VISIT)], [base], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes=dict.fromkeys("abc", "place")), "test")
        robot.listen(records.append)
        return robot.achieve("(forall (?p - place) (visited ?p))", **how), records


@pytest.mark.parametrize("lost", [True, False], ids=["the component is lost", "only its skills fail"])
def test_a_goal_is_reached_after_a_short_outage(lost):
    base = Base(7, 27, lost=lost)
    end, records = visited(base)
    assert end.reached
    assert len(base.begun) < 12
    assert records[-1].t < 60
    waits = [one.data for one in records if one.type == "plan.waits"]
    assert {one["component"] for one in waits} == {"base"}


@pytest.mark.parametrize("lost", [True, False])
def test_a_goal_is_given_up_after_a_long_outage_and_the_reason_names_it(lost):
    end, records = visited(Base(7, 100_000, lost=lost), replans=3)
    assert not end.reached
    (gave_up,) = end.emitted
    assert "no answer" in gave_up.attributes["reason"] or "it reboots" in gave_up.attributes["reason"]
    assert 20 < records[-1].t < 200


def test_a_longer_budget_of_seconds_waits_for_a_longer_outage():
    assert visited(Base(7, 400), replans=3, seconds=200)[0].reached


def test_a_single_error_is_answered_at_once():
    base = Base(7, 7.05, lost=False)
    end, records = visited(base)
    assert end.reached
    assert not [one for one in records if one.type == "plan.waits"]
