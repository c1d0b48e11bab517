from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from knowledge_base.facts import Fact
from planning.analysis.explanation import goal_mutexes
from planning.model.cancellable_work import WorkLimit
from planning.model.ground_action import GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem

FACTS = tuple(Fact("p", (i,)) for i in range(5))
HOME, AWAY, TIRED = Fact("home"), Fact("away"), Fact("tired")
GO = GroundAction(PlanStep("go"), (HOME,), (AWAY, TIRED), (HOME,))


def pairs(problem):
    return list(goal_mutexes(problem, WorkLimit()))


def test_an_action_that_deletes_one_fact_to_add_another_makes_them_exclusive():
    assert pairs(Problem("d", {}, (HOME,), (HOME, AWAY, TIRED), (GO,))) == [(HOME, AWAY), (HOME, TIRED)]


def test_facts_that_hold_together_after_two_actions_are_not_exclusive():
    back = GroundAction(PlanStep("back"), (AWAY,), (HOME,), (AWAY,))
    assert pairs(Problem("d", {}, (HOME,), (HOME, AWAY, TIRED), (GO, back))) == [(HOME, AWAY)]


_some = st.lists(st.sampled_from(FACTS), max_size=2).map(lambda facts: tuple(dict.fromkeys(facts)))


@given(st.lists(st.tuples(_some, _some, _some), max_size=4), _some)
def test_facts_reported_as_exclusive_never_hold_together(actions, init):
    made = [
        GroundAction(PlanStep(f"a{i}"), needs, adds, tuple(one for one in gone if one not in adds))
        for i, (needs, adds, gone) in enumerate(actions)
    ]
    seen, agenda = {frozenset(init)}, [frozenset(init)]
    while agenda:
        state = agenda.pop()
        agenda += (fresh := {one.apply(state) for one in made if one.applicable(state)} - seen)
        seen |= fresh
    held = {pair for state in seen for pair in itertools.permutations(state, 2)}
    assert held.isdisjoint(pairs(Problem("d", {}, init, FACTS, tuple(made))))
