"""Robots whose goals, actions and plots ask for derived predicates."""

from __future__ import annotations

import pytest
from breadth_first import BreadthFirst
from obedient_robot import FAILED, ObedientRobot, plots

from dsc import PlotError, parse_plot
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import PlanningDomain, Robot

ROOMS = """(define (domain rooms) (:types room thing)
  (:predicates (door ?a ?b - room) (near ?a ?b - room) (connected ?a ?b - room) (closed ?a - room) (at ?a - room)
               (lies ?t - thing ?a - room) (held ?t - thing) (busy) (tidy ?t - thing) (reachable ?t - thing))
  (:derived (near ?a ?b - room) (or (door ?a ?b) (door ?b ?a)))
  (:derived (connected ?a ?b - room)
    (or (near ?a ?b) (exists (?c - room) (and (near ?a ?c) (not (closed ?c)) (connected ?c ?b)))))
  (:derived (busy) (exists (?t - thing) (held ?t)))
  (:derived (tidy ?t - thing) (exists (?a - room) (and (lies ?t ?a) (not (at ?a)))))
  (:derived (reachable ?t - thing) (exists (?a ?b - room) (and (lies ?t ?a) (at ?b) (connected ?b ?a))))
  (:action drive :parameters (?a ?b - room) :precondition (and (at ?a) (connected ?a ?b))
    :effect (and (not (at ?a)) (at ?b)))
  (:action take :parameters (?t - thing ?a - room) :precondition (and (not (busy)) (at ?a) (lies ?t ?a))
    :effect (and (not (lies ?t ?a)) (held ?t)))
  (:action put :parameters (?t - thing ?a - room) :precondition (and (busy) (held ?t) (at ?a))
    :effect (and (not (held ?t)) (lies ?t ?a))))
"""
DOMAIN = PlanningDomain.parse(ROOMS, "rooms.pddl")
SECONDS = 0.8
"""A plan has been found by then, and its first step has not ended."""


class Run:
    """A robot in rooms a-b-c-d in a row, a cup in c; what somebody else does, by seconds."""

    def __init__(self, goal, *known, then=(), script=None, lies="c"):
        self.robot = ObedientRobot(DOMAIN, script)
        program = Robot(DOMAIN, plots(DOMAIN), [self.robot], planner=BreadthFirst(), clock="simulated")
        self.knowledge = self.robot.knowledge = program.knowledge
        doors = [fact("door", *pair) for pair in ("ab", "cb", "cd")]
        nodes = {**dict.fromkeys("abcd", "room"), "cup": "thing"}
        self.knowledge.apply(
            Delta(nodes=nodes, added=(*doors, fact("at", "a"), fact("lies", "cup", lies), *known)), "t"
        )
        self.types: list[str] = []
        program.listen(lambda record: self.types.append(record.type))

        def prepare(sequencer):
            for seconds, delta in then:
                sequencer.change(delta, "somebody", after=seconds)

        budget = {"goal": goal, "holder": "", "replans": 4, "seconds": 5}
        self.end = program.run("achieve", budget, prepare=prepare)
        self.outcome = self.end.emitted[-1] if self.end.emitted else None


def test_a_derived_goal_that_holds_already_asks_nobody():
    run = Run("(and (tidy cup) (reachable cup))")
    assert (run.end.finished, run.outcome, run.robot.done) == (True, None, [])
    assert "plan.asked" not in run.types


def test_a_derived_goal_is_planned_for_carried_out_and_seen_to_be_reached():
    run = Run("(busy)")
    assert (run.end.finished, run.outcome) == (True, None)
    assert run.robot.done == ["(drive a c)", "(take cup c)"]
    assert run.types.count("plan.found") == 1
    assert "plan.broken" not in run.types


def test_a_recursive_goal_and_recursive_preconditions():
    run = Run("(forall (?t - thing) (and (lies ?t d) (tidy ?t) (reachable ?t)))")
    assert (run.end.finished, run.outcome) == (True, None)
    assert run.robot.done[:4] == ["(drive a c)", "(take cup c)", "(drive c d)", "(put cup d)"]
    assert run.robot.done[4].startswith("(drive d ")
    assert run.types.count("plan.found") == 1


def test_a_recursive_predicate_that_ceases_to_hold_breaks_the_plan():
    """The door to the last room is walled up while the robot is on its way."""
    run = Run("(at d)", fact("closed", "c"), then=[(SECONDS, Delta(removed=(fact("door", "c", "d"),)))])
    assert run.types.count("plan.broken") == 1
    assert (run.outcome.name, run.knowledge.ask("(at d)")) == ("no_plan", False)
    assert "(at d)" in run.outcome.attributes["reason"]


def test_a_recursive_predicate_that_begins_to_hold_is_made_use_of():
    run = Run(
        "(at d)", fact("closed", "c"), fact("closed", "b"), then=[(SECONDS, Delta(removed=(fact("closed", "b"),)))]
    )
    assert (run.end.finished, run.outcome) == (True, None)
    assert run.knowledge.ask("(at d)")


def test_a_derived_goal_that_somebody_else_brings_about_ends_the_work():
    run = Run("(busy)", then=[(SECONDS, Delta(added=(fact("held", "cup"),), removed=(fact("lies", "cup", "c"),)))])
    assert (run.end.finished, run.outcome) == (True, None)
    assert run.types.count("plan.found") == 1
    assert "(take cup c)" not in run.robot.done


def test_a_transient_failure_is_retried_with_derived_conditions():
    run = Run("(busy)", script={"(take cup c)": [FAILED]})
    assert run.robot.done == ["(drive a c)", "(take cup c)", "(take cup c)"]
    assert (run.outcome, run.types.count("plan.asked")) == (None, 1)


@pytest.mark.parametrize(
    "goal", ["(and (busy) (not (busy)))", "(exists (?a ?b - room) (and (at ?a) (at ?b) (not (= ?a ?b))))"]
)
def test_an_unreachable_goal_ends_with_the_outcome_no_plan(goal):
    assert Run(goal).outcome.name == "no_plan"


@pytest.mark.parametrize(("held", "chosen"), [((), "idle"), ((fact("held", "cup"),), "hurry")])
def test_plots_read_derived_predicates_in_conditions_and_guards(held, chosen):
    look = """
    plot: look
    states:
      first: {dynamic: [idle, hurry], on: {done: then, no_candidate: lost}}
      then: {choice: [{when: (near c d), to: over}, lost]}
      over: {final: true}
      lost: {final: true, emit: lost}
    emits: {lost: }
    """
    parts = [
        f"{{plot: {name}, when: {when}, states: {{e: {{final: true}}}}}}"
        for name, when in (("idle", "(not (busy))"), ("hurry", "(busy)"))
    ]
    chosen_plots: list[str] = []
    with Robot(DOMAIN, [parse_plot(text) for text in (look, *parts)], [], clock="simulated") as program:
        known = (fact("door", "d", "c"), *held)
        program.knowledge.apply(Delta(nodes={"c": "room", "d": "room", "cup": "thing"}, added=known), "t")
        program.listen(lambda one: chosen_plots.append(one.data["chosen"]) if one.type == "decision" else None)
        end = program.run("look")
    assert (end.finished, end.emitted, chosen_plots) == (True, (), [chosen])


def test_a_plot_that_reads_a_recursive_predicate_is_refused():
    text = "{plot: p, states: {a: {always: {when: (connected c d), to: e}}, e: {final: true}}}"
    with pytest.raises(PlotError, match="'connected' is a recursive derived predicate, which only goals"):
        Robot(DOMAIN, [parse_plot(text)], [], clock="simulated")


def test_a_plan_that_is_over_is_not_examined_again_when_a_recursive_predicate_changes():
    main = """
    plot: main
    states:
      get: {goal: (at d), on: {done: rest, no_plan: rest, gave_up: rest}}
      rest: {after: {seconds: 100, to: over}}
      over: {final: true}
    """
    records: list[Record] = []
    robot = ObedientRobot(DOMAIN)
    with Robot(
        DOMAIN, [*plots(DOMAIN), parse_plot(main)], [robot], planner=BreadthFirst(), clock="simulated"
    ) as program:
        robot.knowledge = program.knowledge
        doors = [fact("door", *pair) for pair in ("ab", "cb", "cd")]
        nodes = dict.fromkeys("abcd", "room")
        program.knowledge.apply(Delta(nodes=nodes, added=(*doors, fact("at", "a"))), "t")
        program.listen(records.append)
        gone = Delta(removed=(fact("door", "c", "d"), fact("at", "d")), added=(fact("at", "a"),))
        end = program.run("main", prepare=lambda sequencer: sequencer.change(gone, "somebody", after=50))
    assert end
    assert max(record.t for record in records if record.type.startswith("plan.")) < 50
