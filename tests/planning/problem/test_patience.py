"""Posing a problem ends when its time is up, and when nobody waits for it any more."""

import asyncio
import threading

import pytest

from dsc import Component, Event, Outcome, SkillCall, parse_plot, skill
from knowledge_base import Delta, fact
from knowledge_base.language.syntax.text import parse_condition
from planning import PlanningDomain, Robot
from planning.model.cancellable_work import WorkLimit, WorkLimitError, aside
from planning.problem.construction import build_problem

# Nothing needs the parameters, so that any choice will do, of which there are 30 ** 7.
MANY = """(define (domain many) (:types thing) (:predicates (p ?a - thing) (g))
  (:action a :parameters (?a ?b ?c ?d ?e ?f ?h - thing) :precondition PRECONDITION :effect (g)))"""
LAMPS = """(define (domain lamps) (:types lamp) (:predicates (on ?l - lamp))
  (:action light :parameters (?l ?near ?by - lamp) :effect (on ?l)))"""
GOAL = parse_condition("(g)")
THINGS = Delta(nodes={f"o{i}": "thing" for i in range(30)}, added=(fact("p", "o1"),))
FACTS = Delta(nodes=THINGS.nodes, added=tuple(fact("p", name) for name in THINGS.nodes))
JOINED = "(and (p ?a) (p ?b) (p ?c) (p ?d) (p ?e) (p ?f) (p ?h) (not (p ?a)))"


def many(precondition="(p ?a)"):
    return PlanningDomain.parse(MANY.replace("PRECONDITION", precondition))


@pytest.mark.parametrize(
    "precondition",
    [
        "(p ?a)",
        JOINED,
        "(exists (?x ?y ?z ?u ?v ?w - thing) (and (not (p ?x)) (g) (p ?y) (p ?z) (p ?u) (p ?v) (p ?w)))",
    ],
    ids=["choices of objects", "joins of facts", "quantifiers"],
)
def test_posing_ends_when_its_time_is_up(precondition, world_of):
    domain = many(precondition)
    world = world_of(domain.schema, FACTS.nodes, FACTS.added)
    with pytest.raises(WorkLimitError, match="out of time while grounding action 'a'"):
        build_problem(domain, world, GOAL, patience=WorkLimit(0.01))


def test_a_goal_with_too_many_parts_for_the_time_says_so(world_of):
    domain = many()
    world = world_of(domain.schema, THINGS.nodes)
    goal = parse_condition("(exists (?x ?y ?z ?u ?v ?w - thing) (and (g) (not (p ?x)) (p ?y) (p ?z) (p ?u) (p ?v)))")
    with pytest.raises(WorkLimitError, match="out of time while grounding the goal"):
        build_problem(domain, world, goal, patience=WorkLimit(0.01))


def test_an_interrupted_construction_does_not_affect_the_next_problem(world_of):
    domain = PlanningDomain.parse(LAMPS)
    small, large = (world_of(domain.schema, {f"l{i}": "lamp" for i in range(n)}) for n in (2, 8))
    goal = parse_condition("(forall (?l - lamp) (on ?l))")
    first = build_problem(domain, small, goal)
    with pytest.raises(WorkLimitError):
        build_problem(domain, large, goal, patience=WorkLimit(0.0))
    assert build_problem(domain, small, goal) == first
    assert build_problem(domain, large, goal) == build_problem(PlanningDomain.parse(LAMPS), large, goal)


def test_without_a_limit_it_takes_what_it_takes():
    patience = WorkLimit()
    for _ in range(10_000):
        patience.spend()
    patience.cancel()
    with pytest.raises(WorkLimitError):
        patience.spend()


def test_work_that_does_not_ask_is_left_alone_when_its_time_is_up():
    never = threading.Event()
    with pytest.raises(WorkLimitError):
        asyncio.run(aside(never.wait, WorkLimit(0.01)))
    never.set()


def test_an_exception_of_background_work_reaches_its_caller():
    with pytest.raises(ZeroDivisionError):
        asyncio.run(aside(lambda: 1 / 0))


@pytest.mark.parametrize("error", [StopIteration("dry"), SystemExit("out"), GeneratorExit("shut")], ids=repr)
def test_an_exception_that_a_future_refuses_reaches_the_caller_of_background_work(error):
    def work():
        raise error

    with pytest.raises(RuntimeError, match=str(error)) as raised:
        asyncio.run(asyncio.wait_for(aside(work), 5.0))
    assert raised.value.__cause__ is error


class Acted(Outcome): ...


class Idle(Component):
    name = "idle"

    @skill
    async def act(self, call: SkillCall) -> Acted:
        return Acted()


WORKING = """
plot: top
receives: {stop: }
emits: {ended: {how: text}}
states:
  work:
    goal: (g)
    budget: {seconds: SECONDS}
    on:
      done: {to: end, emit: ended, with: {how: reached}}
      no_plan: {to: end, emit: ended, with: {how: ?event.reason}}
      gave_up: {to: end, emit: ended, with: {how: ?event.reason}}
      stop: {to: end, emit: ended, with: {how: stopped}}
  end: {final: true}
"""


def run(seconds, prepare=None, *, clock):
    program = Robot(many(), [parse_plot(WORKING.replace("SECONDS", str(seconds)))], [Idle()], clock=clock)
    program.knowledge.apply(THINGS, "test")
    end = program.run("top", prepare=prepare)
    return end.emitted[-1].attributes["how"]


def test_a_stop_while_the_problem_is_posed_ends_the_run_and_the_work():
    before = set(threading.enumerate())
    assert run(3600, lambda sequencer: sequencer.post(Event("stop"), after=0.05), clock="real") == "stopped"
    for thread in set(threading.enumerate()) - before:
        thread.join(30)
        assert not thread.is_alive()


@pytest.mark.parametrize("clock", ["real", "simulated"])
def test_the_budget_is_for_posing_as_well(clock):
    assert run(0.05, clock=clock).startswith("no plan within 0.05 s (while grounding action 'a')")
