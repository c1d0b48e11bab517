"""Functions that are no numbers, in domains that are planned with: what does not change is looked up."""

import pytest

from knowledge_base import fact
from knowledge_base.language.syntax.text import parse_condition
from planning.model.domain import PlanningDomain
from planning.model.problem import UnsupportedActionError, UnsupportedGoalError
from planning.problem.construction import build_problem

PAINTING = """(define (domain painting) (:types thing place)
  (:predicates (at ?p - place) (touched ?t - thing) (known ?l - text) (seen ?t - thing))
  (:functions (label ?t - thing) (stamp ?t - thing) - text (pose ?t - thing ?p - place) - geometry
              (locked ?t - thing) - boolean)
  (:action touch :parameters (?t - thing)
    :precondition (and (= (label ?t) "red") (= (locked ?t) false) (known (label ?t)))
    :effect (touched ?t))
  (:action mark :parameters (?t - thing) :effect (and (assign (stamp ?t) "done") (seen ?t)))
  (:action check :parameters (?t - thing) :precondition CHECK :effect (at home))
  (:constants home - place))"""


@pytest.fixture
def painting():
    return PlanningDomain.parse(PAINTING.replace("CHECK", '(= (stamp ?t) "done")'), "painting.pddl")


@pytest.fixture
def world(painting, world_of):
    values = {fact("label", "red1"): "red", fact("label", "red2"): "red", fact("label", "blue"): "blue",
              fact("locked", "red2"): True, fact("pose", "red1", "home"): (1.0, 2.0)}  # fmt: skip
    things = dict.fromkeys(("red1", "red2", "blue"), "thing")
    return world_of(painting.schema, things, [fact("known", "red")], values)


def test_content_that_no_action_changes_is_evaluated_when_posing(painting, world):
    problem = build_problem(painting, world, parse_condition("(touched red1)"))
    assert [str(action.step) for action in problem.actions] == ["(touch red1)"]
    for never in ("(touched red2)", "(touched blue)"):
        assert build_problem(painting, world, parse_condition(never)).unreachable == (never,)


def test_content_that_is_only_assigned_is_left_out(painting, world):
    (action,) = build_problem(painting, world, parse_condition("(seen blue)")).actions
    assert (str(action.step), action.adds) == ("(mark blue)", (fact("seen", "blue"),))


@pytest.mark.parametrize("condition", ['(= (stamp ?t) "done")', "(known (stamp ?t))"])
def test_an_action_that_asks_for_content_which_actions_change_is_named(world, condition):
    domain = PlanningDomain.parse(PAINTING.replace("CHECK", condition), "painting.pddl")
    with pytest.raises(
        UnsupportedActionError, match=r"painting.pddl:9:.*'check' asks for a value that planning actions change"
    ):
        build_problem(domain, world, parse_condition("(at home)"))


def test_a_goal_that_asks_for_it_is_refused(painting, world):
    with pytest.raises(UnsupportedGoalError, match=r"asks for a value .*: \(= \(stamp red1\)"):
        build_problem(painting, world, parse_condition('(= (stamp red1) "done")'))
