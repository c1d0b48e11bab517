"""Budget and memory of failures belong to the goal: an interruption renews them only after a gain (S1.4)."""

from __future__ import annotations

import pytest

from dsc import Component, Event, Outcome, SkillCall, parse_plot, skill
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """
(define (domain rover)
  (:types place)
  (:predicates (at ?p - place) (visited ?p - place))
  (:action go :parameters (?from ?to - place)
    :precondition (at ?from) :effect (and (not (at ?from)) (at ?to) (visited ?to))))
"""
GO = """
plot: go
implements: go
parameters: {from: place, to: place}
confirm: 1
states:
  drive: {entry: {trigger: base.drive, with: {start: ?from, to: ?to}}, on: {arrived: there}}
  there: {final: true}
"""
TOUR = """
plot: tour
receives: {low: }
emits: {failed: {why: text}}
states:
  all:
    goal: (forall (?p - place) (visited ?p))
    budget: {replans: 3}
    on: {done: over, no_plan: over, gave_up: {to: over, emit: failed, with: {why: ?event.reason}}}
  over: {final: true}
handlers:
  - {on: low, interrupt: true, do: {use: charge}}
"""
CHARGE = """
plot: charge
states: {c: {after: {seconds: 1, to: full}}, full: {final: true}}
"""


class Arrived(Outcome): ...


class Base(Component):
    """Drives for five seconds; only some of the drives are observed."""

    name = "base"

    def __init__(self, observed=lambda drives, to: False):
        super().__init__()
        self.drives = 0
        self.observed = observed

    @skill
    async def drive(self, call: SkillCall, start: str, to: str) -> Arrived:
        await call.clock.sleep(5)
        self.drives += 1
        if not self.observed(self.drives, to):
            return Arrived()
        return Arrived(observed=Delta(added=(fact("at", to), fact("visited", to)), removed=(fact("at", start),)))


def tour(base, every, count=300, places="abcd"):
    """How a tour ended that an event interrupts again and again, and how many plans it took."""
    records: list[Record] = []
    with Robot(DOMAIN, [parse_plot(text) for text in (GO, TOUR, CHARGE)], [base], clock="simulated") as robot:
        robot.knowledge.apply(
            Delta(nodes=dict.fromkeys(places, "place"), added=(fact("at", "a"), fact("visited", "a"))), "test"
        )
        robot.listen(records.append)

        def prepare(sequencer):
            for n in range(1, count):
                sequencer.post(Event("low"), after=every * n)

        end = robot.run("tour", prepare=prepare)
    return end, sum(one.type == "plan.found" for one in records), records[-1].t


@pytest.mark.parametrize("every", [3, 8, 20])
def test_interruptions_do_not_renew_the_budget_of_a_goal_that_gets_nowhere(every):
    end, plans, at = tour(Base(), every)
    (failed,) = end.emitted
    assert failed.name == "failed"
    assert plans <= 2 * (3 + 1)
    assert at < 300


def test_the_reason_tells_that_interruptions_ended_the_plans():
    end, _, _ = tour(Base(), 3)
    assert end.emitted[0].attributes["why"] == "interruptions ended 3 plans before a step was completed"


def test_a_goal_fact_that_was_gained_renews_the_budget():
    """Each place takes two interruptions and one unobserved drive; three new plans would not do for all of them."""
    places = "abcdefgh"
    end, plans, _ = tour(Base(lambda drives, _: drives % 2 == 0), 8, places=places)
    assert (end.finished, end.emitted) == (True, ())
    assert plans > 3
