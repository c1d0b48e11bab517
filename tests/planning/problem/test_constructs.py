from __future__ import annotations

import pytest

from knowledge_base.facts import fact
from knowledge_base.language.syntax.text import parse_condition
from planning import Robot
from planning.engines.registry import Engine
from planning.model.domain import PlanningDomain
from planning.model.plan import Unsupported
from planning.problem.relevance import numeric_constructs, why_no_engine

JARS = """(define (domain jars) (:types jar)
  (:predicates (sealed ?j - jar) (full ?j - jar) (washed ?j - jar))
  (:functions (litres ?j - jar) (size ?j - jar))
  (:derived (full ?j - jar) (>= (litres ?j) (size ?j)))
  (:action fill :parameters (?j - jar) :precondition (> (size ?j) 1) :effect (increase (litres ?j) 1))
  (:action seal :parameters (?j - jar) :precondition (> (litres ?j) 2) :effect (sealed ?j))
  (:action wash :parameters (?j - jar) :effect (washed ?j)))
"""


@pytest.fixture(scope="module")
def jars():
    return PlanningDomain.parse(JARS, "jars.pddl")


def found(domain, goal):
    return [str(one) for one in numeric_constructs(domain, parse_condition(goal))]


def test_the_action_and_the_place_are_named(jars):
    [said] = found(jars, "(forall (?j - jar) (sealed ?j))")
    assert said.startswith("jars.pddl:6:")
    assert said.endswith("planning action 'seal' compares numbers that actions change: (> (litres ?j) 2)")


def test_a_goal_about_numbers_is_named_before_actions(jars):
    said = found(jars, "(forall (?j - jar) (and (sealed ?j) (< (litres ?j) 9)))")
    assert "the goal compares numbers that actions change: (< (litres ?j) 9)" in said[0]
    assert "'seal'" in said[1]


def test_a_derived_predicate_is_named_by_what_it_follows_from(jars):
    [said] = found(jars, "(exists (?j - jar) (full ?j))")
    assert "jars.pddl:4:" in said


def test_numbers_that_nobody_changes_ask_nothing_of_an_engine(jars):
    assert found(jars, "(forall (?j - jar) (and (washed ?j) (> (size ?j) 1)))") == []


def test_the_error_for_an_unsupported_goal_names_capable_engines_and_their_install(jars):
    goal = parse_condition("(exists (?j - jar) (sealed ?j))")
    said = why_no_engine(jars, goal, Unsupported("", ("numeric",), (("enhsp", "pip install x"),)))
    assert said.endswith("(> (litres ?j) 2); no installed engine can do that, enhsp could (pip install x)")
    said = why_no_engine(jars, goal, Unsupported("pyperplan", ("numeric",), ()))
    assert said.endswith("(> (litres ?j) 2); pyperplan cannot do that, nor can any engine known here")


def test_without_such_a_construct_it_is_said_what_is_needed(jars):
    said = why_no_engine(jars, parse_condition("(washed a)"), Unsupported("", (), (("enhsp", ""),)))
    assert (
        said
        == "the problem needs STRIPS; no permitted engine can do that, enhsp could (it is installed: permit or name it)"
    )


def test_a_robot_says_which_condition_no_installed_engine_can_do(jars, world_of, monkeypatch):
    monkeypatch.setattr(Engine, "lacks", lambda one: "" if one.name == "pyperplan" else f"install {one.name}")
    robot = Robot(jars, [], [], world_of(jars.schema, {"a": "jar"}, values={fact("size", "a"): 2}), clock="simulated")
    with robot:
        [outcome] = robot.achieve("(sealed a)").emitted
    reason = outcome.attributes["reason"]
    assert (outcome.name, "jars.pddl:6:" in reason, "(> (litres ?j) 2)" in reason) == ("no_plan", True, True)
    assert "no installed engine can do that, kairos could (install kairos), enhsp could (install enhsp)" in reason
