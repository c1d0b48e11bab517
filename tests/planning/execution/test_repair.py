"""The rungs between rules and giving up, by themselves; and what counts as the same situation."""

import pytest

from knowledge_base import Delta, KnowledgeBase, fact
from knowledge_base.language.syntax.text import parse_condition
from planning import PlanningDomain, PlanStep
from planning.execution.attempt import MOST_RESUMED, Attempt, EscalationStep, Failure
from planning.execution.escalation import situation
from planning.execution.search import without
from planning.model.ground_action import GroundAction
from planning.model.problem import Problem

STEP = PlanStep("go", ("a", "b"))
HERE = Failure(STEP, "no_path", "here")


@pytest.mark.parametrize(
    ("is_valid", "others", "rungs"),
    [
        (
            True,
            True,
            [
                EscalationStep.RESUME,
                EscalationStep.OTHER_CANDIDATE,
                EscalationStep.EXCLUDE,
                EscalationStep.GIVE_UP,
                EscalationStep.GIVE_UP,
            ],
        ),
        (True, False, [EscalationStep.RESUME, EscalationStep.EXCLUDE, EscalationStep.GIVE_UP]),
        (False, True, [EscalationStep.REPLAN, EscalationStep.EXCLUDE, EscalationStep.GIVE_UP]),
    ],
)
def test_the_same_failure_in_the_same_situation_gets_the_next_answer(is_valid, others, rungs):
    attempt = Attempt()
    assert [attempt.failed(HERE, is_valid=is_valid, others=others) for _ in rungs] == rungs


def test_another_failure_or_another_situation_begins_anew():
    attempt = Attempt()
    for failure in (HERE, Failure(STEP, "no_path", "there"), Failure(STEP, "slipped", "here")):
        assert attempt.failed(failure, is_valid=True, others=False) is EscalationStep.RESUME


def test_going_on_at_the_same_step_is_bounded_whatever_the_situation():
    attempt = Attempt()
    attempt.resumed[STEP] = MOST_RESUMED
    assert attempt.failed(HERE, is_valid=True, others=True) is EscalationStep.REPLAN
    assert attempt.interrupted(STEP) is EscalationStep.REPLAN
    assert attempt.interrupted(PlanStep("stay")) is EscalationStep.RESUME
    assert attempt.interrupted(None) is EscalationStep.REPLAN


def test_new_plans_and_disturbances_by_others_have_their_own_budgets():
    attempt = Attempt()
    assert [attempt.replan(2, disturbed=True) for _ in range(3)] == [True, True, False]
    assert [attempt.replan(1, disturbed=False) for _ in range(2)] == [True, False]


DOMAIN = PlanningDomain.parse("""
(define (domain places)
  (:types room)
  (:predicates (at ?r - room) (free ?r - room) (warm ?r - room))
  (:functions (level ?r - room) (tries ?r - room))
  (:action go :parameters (?from ?to - room) :precondition (and (at ?from) (free ?to) (> (level ?to) 1))
    :effect (and (not (at ?from)) (at ?to)))
  (:action heat :parameters (?r - room) :precondition (at ?r) :effect (warm ?r)))
""")


@pytest.mark.parametrize(
    ("delta", "same"),
    [
        (Delta(added=(fact("warm", "a"),)), True),
        (Delta(values={fact("tries", "b"): 2.0}), True),
        (Delta(added=(fact("free", "b"),)), False),
        (Delta(values={fact("level", "b"): 2.0}), False),
        (Delta(nodes={"c": "room"}), False),
    ],
    ids=["other_predicate", "other_number", "predicate", "number", "thing"],
)
def test_a_situation_is_what_the_problem_depends_on(delta, same):
    kb = KnowledgeBase(DOMAIN.schema)
    kb.apply(Delta(nodes={"a": "room", "b": "room"}, added=(fact("at", "a"),)), "test")
    goal = parse_condition("(at b)")
    before = situation(DOMAIN, kb, goal)
    kb.apply(delta, "test")
    assert (situation(DOMAIN, kb, goal) == before) == same


def test_a_problem_without_some_steps_is_without_them_as_a_whole_too():
    go = GroundAction(STEP, (), (fact("at", "b"),), ())
    other = GroundAction(PlanStep("go", ("c", "b")), (), (fact("at", "b"),), ())
    closing = GroundAction(None, (), (fact("done"),), ())
    whole = Problem("places", {}, (), (fact("at", "b"),), (go, other, closing))
    narrowed = without(Problem("places", {}, (), (fact("at", "b"),), (go, closing), unsliced=lambda: whole), {STEP})
    assert narrowed.actions == (closing,)
    assert narrowed.whole is not None
    assert narrowed.whole.actions == (other, closing)
