from __future__ import annotations

import itertools
from collections import deque

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from searching import solution

from knowledge_base.errors import UnknownNameError
from knowledge_base.facts import Delta, fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.overlay import Overlay
from planning.analysis.explanation import why_unsolvable
from planning.analysis.validation import validate
from planning.model.domain import PlanningDomain
from planning.model.plan import PlanStep
from planning.model.problem import UnsupportedActionError, UnsupportedGoalError
from planning.problem.axioms import Derivable
from planning.problem.derived import derivation

ROOMS, DOORS = "abc", (("a", "b"), ("b", "c"))
BASE = ("open", "stuck", "at", "lit")
GRID = """(define (domain grid) (:types room)
  (:predicates (door ?a ?b - room) (open ?a ?b - room) (stuck ?a - room) (at ?a - room) (reach ?a ?b - room)
    (lit ?a - room) (sees ?a - room))
  (:derived (reach ?a ?b - room) (or (= ?a ?b) (exists (?c - room)
    (and (reach ?a ?c) (open ?c ?b) (not (stuck ?b))))))
  (:derived (sees ?a - room) (exists (?b - room) (and (reach ?a ?b) (lit ?b))))
  (:action walk :parameters (?a ?b - room) :precondition (and (at ?a) (reach ?a ?b)) :effect (and (not (at ?a)) (at ?b)))
  (:action swing :parameters (?a ?b - room) :precondition (and (at ?a) (door ?a ?b))
    :effect (and (when (open ?a ?b) (not (open ?a ?b))) (when (not (open ?a ?b)) (open ?a ?b)) (stuck ?b)))
  (:action oil :parameters (?a - room) :precondition (stuck ?a) :effect (not (stuck ?a)))
  (:action cover :parameters (?a - room) :precondition (at ?a) :effect (forall (?b - room) (not (lit ?b)))))
"""


def grid(*facts) -> tuple[PlanningDomain, KnowledgeBase]:
    domain = PlanningDomain.parse(GRID, "grid.pddl")
    world = KnowledgeBase(domain.schema)
    doors = tuple(fact("door", *pair) for pair in DOORS)
    world.apply(Delta(nodes=dict.fromkeys(ROOMS, "room"), added=(*doors, *facts)), author="test")
    return domain, world


def plan_for(domain, world, goal):
    return solution(Derivable.of(domain).build_problem(world, parse_condition(goal)), eagerly)


def eagerly(problem):
    """A plan that derives all that follows as soon as it does, which never hurts; without numbers."""
    books = [i for i, action in enumerate(problem.actions) if action.step is None and not action.deletes]

    def derived(state, taken):
        while (more := next((i for i in books if _is_new(problem.actions[i], state)), None)) is not None:
            state, taken = problem.actions[more].apply(state), (*taken, more)
        return state, taken

    agenda = deque([derived(frozenset(problem.init), ())])
    seen = {agenda[0][0]}
    while agenda:
        state, taken = agenda.popleft()
        if all(one in state for one in problem.goal):
            return taken
        for i, action in enumerate(problem.actions):
            if i not in books and action.applicable(state):
                ahead = derived(action.apply(state), (*taken, i))
                if ahead[0] not in seen:
                    seen.add(ahead[0])
                    agenda.append(ahead)
    return None


def _is_new(action, state):
    return action.applicable(state) and not state.issuperset(action.adds)


def reachable(domain, world, goal):
    """Whether it can be done at all, by carrying out everything in thought."""
    derived = derivation(domain)
    wanted = derived.expand(parse_condition(goal))
    steps = [
        PlanStep(name, args)
        for name, action in domain.actions.items()
        for args in itertools.product(ROOMS, repeat=len(action.parameters))
    ]
    agenda, seen = [Overlay(world)], set()
    while agenda:
        now = agenda.pop()
        complete = derived.complete(now)
        if holds(wanted, complete):
            return True
        for step in steps:
            if derived.domain.applicable(step, complete):
                ahead = Overlay(world)
                ahead.apply(now.delta)
                ahead.apply(derived.domain.effects(step, complete))
                facts = frozenset(str(one) for name in BASE for one in facts_of(ahead, domain, name))
                if facts not in seen:
                    seen.add(facts)
                    agenda.append(ahead)
    return False


def facts_of(world, domain, name):
    arity = len(domain.schema.predicates[name].parameters)
    return [(name, args) for args in world.match(name, (None,) * arity)]


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    st.sets(st.sampled_from(DOORS)),
    st.sets(st.sampled_from(ROOMS), max_size=2),
    st.lists(
        st.sampled_from(["(at c)", "(reach a c)", "(stuck c)", "(sees a)", "(not (lit b))"]),
        min_size=1,
        max_size=2,
        unique=True,
    ),
)
def test_there_is_a_plan_if_and_only_if_the_axioms_say_so(opened, stuck, parts):
    domain, world = grid(
        fact("at", "a"),
        fact("lit", "b"),
        *(fact("open", *one) for one in opened),
        *(fact("stuck", one) for one in stuck),
    )
    goal = f"(and {' '.join(parts)})"
    plan = plan_for(domain, world, goal)
    assert (plan is not None) == reachable(domain, world, goal)
    if plan is not None:
        assert validate(plan, domain, world, parse_condition(goal)).valid
        assert all(step.action in domain.actions for step in plan.steps)


def test_a_derived_fact_ends_with_the_facts_that_it_follows_from():
    """The goal asks for a way and for its last room to be stuck, which ends the way."""
    domain, world = grid(fact("at", "a"), fact("open", "a", "b"), fact("open", "b", "c"))
    assert plan_for(domain, world, "(reach a c)").steps == ()
    assert plan_for(domain, world, "(and (reach a c) (stuck c))") is None
    wanted = parse_condition("(and (reach a c) (stuck c))")
    (why,) = why_unsolvable(*Derivable.of(domain).without_axioms(world, wanted))
    assert why == "(reach a c) and (stuck c) can never hold together"


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (
            "(not (reach a c))",
            r"the goal asks for the opposite of 'reach'.*grid.pddl:4:.*'open', 'stuck'.*Fast Downward",
        ),
        ("(imply (sees a) (lit a))", "the goal asks for the opposite of 'reach'"),
    ],
)
def test_a_goal_that_negates_a_derived_predicate_is_refused(goal, said):
    with pytest.raises(UnsupportedGoalError, match=said):
        plan_for(*grid(fact("at", "a")), goal)


def test_an_action_that_asks_for_that_is_named_with_its_place():
    text = GRID.replace(
        "(:action oil",
        "(:action cry :parameters (?a - room) :precondition (not (sees ?a)) :effect (lit ?a))\n  (:action oil",
    )
    domain, (_, world) = PlanningDomain.parse(text, "grid.pddl"), grid(fact("at", "a"))
    with pytest.raises(
        UnsupportedActionError, match="the planning action 'cry' asks for the opposite of 'reach'"
    ) as caught:
        plan_for(domain, world, "(lit c)")
    assert caught.value.place.source == "grid.pddl"


def test_a_mistake_in_the_goal_is_an_error():
    with pytest.raises(UnknownNameError, match="'reach'"):
        plan_for(*grid(), "(reech a c)")


def test_other_domains_need_none_of_it(clean_up):
    assert Derivable.of(clean_up) is None
