"""The shortest end of a plan is the one that a simulation of every end finds."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from order_strategies import Planned, planned

from knowledge_base.world.overlay import Overlay
from planning.execution.plan_ends import leads_to, shortest_end


def simulated(steps, domain, world, goal):
    ends = (tuple(steps[first:]) for first in range(len(steps), -1, -1))
    return next((end for end in ends if leads_to(end, domain, world, goal)), None)


@settings(max_examples=200, derandomize=True, deadline=None)
@given(planned(), st.data())
def test_the_shortest_end_is_the_one_that_simulation_finds(case: Planned, data) -> None:
    steps = case.plan.steps
    world = Overlay(case.world)
    for step in steps[: data.draw(st.integers(0, len(steps)))]:
        world.apply(case.domain.effects(step, world))
    mixed = tuple(data.draw(st.lists(st.sampled_from(steps), max_size=6))) if steps else ()
    for plan in (steps, mixed, (*mixed, *steps)):
        assert shortest_end(plan, case.domain, world, case.goal) == simulated(plan, case.domain, world, case.goal)
