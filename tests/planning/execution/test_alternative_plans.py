"""A foresight that tells the cost of plans: the robot executes the cheapest of several alternatives (S1.20)."""

from __future__ import annotations

import random

import pytest

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import PlanningDomain, Robot, Validation

DOMAIN = PlanningDomain.parse("""
(define (domain rover) (:types place)
  (:predicates (at ?p - place) (way ?origin ?to - place) (blocked ?p - place) (seen ?p - place))
  (:action drive :parameters (?origin ?to - place)
    :precondition (and (at ?origin) (way ?origin ?to)) :effect (and (not (at ?origin)) (at ?to))))
""")
WAYS = [("home", "mud"), ("mud", "goal"), ("home", "road"), ("road", "goal"), ("home", "lake"), ("lake", "goal")]


class Driven(Outcome): ...


class Wheels(Component):
    name = "wheels"

    def __init__(self):
        super().__init__()
        self.driven = []

    @skill
    async def drive(self, call: SkillCall, origin: str, to: str) -> Driven:
        await call.clock.sleep(1)
        self.driven.append(to)
        return Driven(observed=Delta(added=(fact("at", to),), removed=(fact("at", origin),)))


class Seconds:
    """The seconds of each step, by its target; the ways of `blocked` cannot be driven."""

    def __init__(self, seconds, blocked=()):
        self.seconds, self.blocked = seconds, blocked
        self.asked = []

    def foresee(self, plan, world):
        targets = [step.args[1] for step in plan.steps]
        self.asked.append(targets)
        for number, target in enumerate(targets):
            if target in self.blocked:
                return Validation(valid=False, failing_step=number, why="the way is blocked")
        costs = [self.seconds[target] for target in targets]
        return Validation(valid=True, cost=sum(costs), costliest_step=costs.index(max(costs)))


def drive(foresight, ways=WAYS, goal="(at goal)", changes=()):
    """Return how the robot's run ended, the places it drove to, and its records about plans."""
    wheels = Wheels()
    records: list[Record] = []
    plot = primitive_plot(wheels.skills()["drive"], done="driven", implements="drive")
    with Robot(DOMAIN, [plot], [wheels], foresight=foresight, clock="simulated") as robot:
        places = {place: "place" for way in ways for place in way}
        told = (fact("at", "home"), *(fact("way", *way) for way in ways))
        robot.knowledge.apply(Delta(nodes=places, added=told), author="map")
        robot.listen(records.append)

        def disturb(sequencer):
            for seconds, delta in changes:
                sequencer.change(delta, "somebody", after=seconds)

        end = robot.achieve(goal, prepare=disturb)
    return end, wheels.driven, [one for one in records if one.type.startswith("plan.")]


def test_the_cheapest_of_several_plans():
    foresight = Seconds({"mud": 50, "road": 5, "lake": 90, "goal": 1})
    end, driven, records = drive(foresight)
    assert end.reached
    assert driven == ["road", "goal"]
    compared = [one.data for one in records if one.type == "plan.compared"]
    assert {one["cost"] for one in compared} <= {6, 51, 91}
    assert min(one["best"] for one in compared) <= 51
    assert sorted(map(tuple, foresight.asked)) == [("lake", "goal"), ("mud", "goal"), ("road", "goal")]


def test_an_alternative_that_the_simulation_rejects():
    _, driven, _ = drive(Seconds({"mud": 50, "road": 5, "lake": 90, "goal": 1}, blocked={"road"}))
    assert driven == ["mud", "goal"]


def test_a_plan_without_an_alternative():
    _, driven, records = drive(Seconds({"road": 5, "goal": 1}), ways=[("home", "road"), ("road", "goal")])
    assert driven == ["road", "goal"]
    assert not [one for one in records if one.type in {"plan.compared", "plan.none"}]


def test_a_simulation_without_costs_is_asked_one_time():
    class Agreeing:
        asked = 0

        def foresee(self, plan, world):
            self.asked += 1
            return Validation(valid=True)

    foresight = Agreeing()
    assert drive(foresight)[0].reached
    assert foresight.asked == 1


@pytest.mark.parametrize("seed", range(10))
def test_no_alternative_is_cheaper(seed):
    draw = random.Random(seed)  # noqa: S311  # a reproducible draw
    costs = {place: draw.randrange(1, 100) for place in ("mud", "road", "lake")} | {"goal": 0}
    _, driven, _ = drive(Seconds(costs))
    assert costs[driven[0]] == min(costs[place] for place in ("mud", "road", "lake"))


class Blocked:
    """Blocked ways, which are facts that the planning domain does not read."""

    reads = ("blocked",)

    def __init__(self):
        self.asked = 0

    def foresee(self, plan, world):
        self.asked += 1
        for number, step in enumerate(plan.steps):
            if world.holds("blocked", (step.args[1],)):
                return Validation(valid=False, failing_step=number, why="the way is blocked")
        return Validation(valid=True)


LONG = [("home", "a"), ("a", "b"), ("b", "goal"), ("a", "c"), ("c", "goal")]


def told(predicate, place):
    return Delta(added=(fact(predicate, place),))


def test_a_running_plan_that_fails_in_the_simulation_after_a_change_by_others():
    first = drive(Blocked(), ways=LONG)[1]
    other = {"b": "c", "c": "b"}[first[1]]
    foresight = Blocked()
    end, driven, records = drive(foresight, ways=LONG, changes=[(0.5, told("blocked", first[1]))])
    assert end.reached
    assert driven == ["a", other, "goal"]  # the first step continues during the search
    (broken,) = [one.data for one in records if one.type == "plan.broken"]
    assert broken["reason"] == f"the simulation foresees a failure: (drive a {first[1]}): the way is blocked"
    assert broken["author"] == "somebody"
    assert broken["link"]["user"] == f"(drive a {first[1]})"


def test_changes_that_the_simulation_does_not_read():
    foresight = Blocked()
    _, driven, records = drive(foresight, ways=LONG, changes=[(0.5, told("seen", "b")), (1.5, told("blocked", "home"))])
    assert len(driven) == 3
    assert foresight.asked == 2  # before the plan, and after the second change
    assert not [one for one in records if one.type == "plan.broken"]


def test_a_simulation_that_fails_during_the_plan():
    class Failing(Blocked):
        def foresee(self, plan, world):
            if self.asked:
                raise RuntimeError("out of memory")
            return super().foresee(plan, world)

    end, _, _ = drive(Failing(), ways=LONG, changes=[(0.5, told("blocked", "home"))])
    assert "out of memory" in (end.programming_error or "")


def test_a_change_after_which_every_plan_fails_in_the_simulation():
    end, _, _ = drive(Blocked(), ways=LONG, changes=[(0.5, told("blocked", "goal"))])
    assert not end.reached
    assert "the simulation foresees that every plan fails" in end.emitted[-1].attributes["reason"]
