"""Causal links and de-ordering: every linearisation is as good as the plan, and no step waits without a reason."""

from __future__ import annotations

from hypothesis import given, settings
from order_strategies import Planned, planned

from knowledge_base.language.evaluation import holds
from knowledge_base.overlay import Overlay
from planning.order import PartialOrder, deordered, standing
from planning.plan import Plan, PlanStep
from planning.validation import validate


def linearisations(order: PartialOrder):
    def extend(taken):
        if len(taken) == len(order.steps):
            yield taken
        for number, needed in order.earlier.items():
            if number not in taken and needed <= set(taken):
                yield from extend((*taken, number))

    return extend(())


def steps(*texts):
    words = (text.split() for text in texts)
    return tuple(PlanStep(name, tuple(args)) for name, *args in words)


# -- random plans, all linearisations ------------------------------------------------------------------------


@settings(max_examples=300, derandomize=True, deadline=None)
@given(planned())
def test_every_linearisation_leads_to_the_goal(case: Planned):
    order = deordered(case.plan, case.domain, case.world, case.goal)
    for taken in linearisations(order):
        plan = Plan(tuple(order.steps[number - 1] for number in taken))
        found = validate(plan, case.domain, case.world, case.goal)
        assert found.valid, (taken, found)


@settings(max_examples=200, derandomize=True, deadline=None)
@given(planned())
def test_every_linearisation_ends_in_the_same_world_and_keeps_what_stands(case: Planned):
    order = deordered(case.plan, case.domain, case.world, case.goal)
    ends = []
    for taken in linearisations(order):
        ahead = Overlay(case.world)
        for count, number in enumerate(taken):
            done = taken[:count]
            assert all(holds(link.fact, ahead) for link in standing(order.links, done, done)), (taken, count)
            step = order.steps[number - 1]
            ahead.apply(case.domain.effects(step, ahead))
        assert all(holds(link.fact, ahead) for link in standing(order.links, taken, taken)), taken
        ends.append((set(ahead.delta.added), set(ahead.delta.removed), ahead.delta.values))
    assert all(end == ends[0] for end in ends)
