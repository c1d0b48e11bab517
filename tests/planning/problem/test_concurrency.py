"""Problems that need two durative actions at once: posed with durations, and schedules judged along the time line."""

from __future__ import annotations

import asyncio
import itertools
import json

import pytest
from fake_engines import answering
from fake_engines import planner as fake
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_base.facts import Delta, fact
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from planning import PlanningDomain, Robot
from planning.analysis.validation import validate
from planning.engines import planner as planner_module
from planning.engines.planner import PlannerProcess
from planning.engines.race import PlannerRace
from planning.engines.registry import engine
from planning.engines.request import read, write_problem
from planning.model.plan import EngineFailed, NoneFound, Plan, PlanFound, PlanStep, ProvenUnsolvable, Timing
from planning.problem.construction import build_problem

CELLAR = """(define (domain cellar) (:types match fuse)
  (:predicates (free) (unused ?m - match) (mended ?f - fuse) (light ?m - match) (counted) (looked) (sound ?f - fuse))
  (:functions (burns ?m - match))
  (:derived (sound ?f - fuse) (mended ?f))
  (:durative-action strike :parameters (?m - match) :duration (= ?duration (burns ?m))
    :condition (at start (unused ?m))
    :effect (and (at start (not (unused ?m))) (at start (light ?m)) (at end (not (light ?m)))))
  (:durative-action mend :parameters (?f - fuse ?m - match) :duration (and (>= ?duration 3) (<= ?duration 4))
    :condition (and (at start (free)) (over all (light ?m)) (at end (not (mended ?f))))
    :effect (and (at start (not (free))) (at end (mended ?f)) (at end (free))))
  (:action look :effect (looked))
  (:action count :precondition (free) :effect (counted)))
"""
GOAL = "(forall (?f - fuse) (sound ?f))"
DOMAIN = PlanningDomain.parse(CELLAR, "cellar.pddl")


def cellar(matches=2, fuses=2, burns=5.0):
    world = KnowledgeBase(DOMAIN.schema)
    names = [f"m{n}" for n in range(matches)]
    nodes = {**dict.fromkeys(names, "match"), **{f"f{n}": "fuse" for n in range(fuses)}}
    values = {fact("burns", name): burns for name in names}
    added = (fact("free"), *(fact("unused", name) for name in names))
    world.apply(Delta(nodes=nodes, added=added, values=values), author="test")
    return world


def posed(goal=GOAL, **world):
    return build_problem(DOMAIN, cellar(**world), parse_condition(goal), durations=True)


def step(text):
    action, *args = text.split()
    return PlanStep(action, tuple(args))


def schedule(*timed):
    return Plan(tuple(step(text) for text, _, _ in timed), tuple(Timing(start, last) for _, start, last in timed))


def indices(problem, *timed):
    steps = [action.step for action in problem.actions]
    return [(steps.index(step(text)), start, last) for text, start, last in timed]


def said(world, *timed, goal=GOAL):
    """What both judges say: the domain's and the ground problem's."""
    found = validate(schedule(*timed), DOMAIN, world, parse_condition(goal))
    timed_form = build_problem(DOMAIN, world, parse_condition(goal), durations=True).timed
    plan = timed_form.scheduled(indices(timed_form, *timed))
    assert found.valid == isinstance(plan, Plan), (found, plan)
    return found


ONE = ("strike m0", 0.0, 5.0)
MENDED = (ONE, ("mend f0 m0", 0.5, 4.0))


def test_a_schedule_that_mends_while_the_match_burns_is_valid():
    assert said(cellar(1, 1), *MENDED).valid


@pytest.mark.parametrize(
    ("timed", "failing", "why"),
    [
        ((ONE, ("mend f0 m0", 1.5, 4.0)), 1, "(light m0)"),
        ((("mend f0 m0", 0.0, 4.0), ("strike m0", 0.5, 5.0)), 0, "(light m0)"),
        ((ONE, ("mend f0 m0", 0.5, 2.0)), 1, "takes 2 s, which is not between 3 and 4"),
        ((("strike m0", 0.0, 6.0), ("mend f0 m0", 0.5, 4.0)), 0, "takes 6 s"),
        ((ONE, ("strike m0", 0.2, 5.0), ("mend f0 m0", 0.5, 4.0)), 1, "(unused m0)"),
    ],
    ids=["goes out", "before the light", "too short", "too long", "used twice"],
)
def test_the_verdict_on_an_invalid_schedule_names_the_failing_step_and_the_reason(timed, failing, why):
    found = said(cellar(1, 1), *timed)
    assert (found.valid, found.failing_step) == (False, failing)
    assert why in found.why


def test_the_goal_is_judged_at_the_end():
    found = said(cellar(1, 2), *MENDED)
    assert (found.failing_step, found.why) == (None, "(mended f1) is false")


def test_two_that_need_the_same_hand_at_one_moment_disturb_each_other():
    timed = (ONE, ("mend f0 m0", 0.5, 4.0), ("mend f1 m0", 0.5, 4.0))
    found = said(cellar(1, 2), *timed)
    assert (found.valid, "at the same moment" in found.why) == (False, True)


def test_an_over_all_condition_may_end_together_with_its_step():
    assert said(cellar(1, 1, burns=4.0), ("strike m0", 0.0, 4.0), ("mend f0 m0", 0.0, 4.0)).valid


def test_an_action_without_duration_has_its_moment():
    timed = (ONE, ("mend f0 m0", 0.5, 4.0), ("count", 4.6, 0.0))
    goal = "(and (mended f0) (counted))"
    assert said(cellar(1, 1), *timed, goal=goal).valid
    assert not said(cellar(1, 1), *timed[:2], ("count", 2.0, 0.0), goal=goal).valid


def test_a_number_that_two_change_at_one_moment_is_changed_by_neither():
    domain = PlanningDomain.parse("""(define (domain d) (:predicates (p ?x)) (:functions (n))
      (:durative-action more :parameters (?x) :duration (= ?duration 1) :effect (at end (increase (n) 1))))""")
    world = KnowledgeBase(domain.schema)
    world.apply(Delta(nodes={"a": "object", "b": "object"}), author="test")
    goal = parse_condition("(= (n) 2)")
    apart = schedule(("more a", 0.0, 1.0), ("more b", 0.5, 1.0))
    together = schedule(("more a", 0.0, 1.0), ("more b", 0.0, 1.0))
    assert [validate(plan, domain, world, goal).valid for plan in (apart, together)] == [True, False]


def test_unknown_names_make_a_schedule_invalid():
    for text in ("strike ghost", "strike f0", "explode m0", "strike"):
        assert validate(schedule((text, 0.0, 5.0)), DOMAIN, cellar(), parse_condition(GOAL)).failing_step == 0


def test_the_posed_problem_has_a_form_with_durations_that_survives_json():
    problem = posed()
    assert problem.unreachable  # one action at a time: the light is out before anything can be mended
    assert problem.one_at_a_time
    assert (problem.features, problem.timed.features) == (frozenset(), {"durations"})
    assert read(json.loads(write_problem(problem.timed))) == problem.timed
    [strike, *_] = problem.timed.actions
    assert (strike.span.least, strike.span.most) == (5.0, 5.0)


def test_a_goal_that_concurrent_actions_cannot_reach_is_proven_unreachable():
    problem = posed(matches=0)
    assert problem.unreachable == ("(mended f0)", "(mended f1)")
    assert not problem.one_at_a_time


def test_goals_without_durative_actions_are_posed_as_ever():
    problem = posed("(looked)")
    assert (problem.timed, problem.one_at_a_time, len(problem.actions)) == (None, False, 1)


@pytest.mark.parametrize("goal", ["(or (mended f0) (mended f1))", "(and (mended f0) (> (burns m0) 3))"])
def test_goals_that_are_posed_with_and_without_durations(goal):
    problem = posed(goal)
    assert problem.one_at_a_time
    assert (problem.timed is None) == goal.startswith("(or")


def solved(planner, problem, seconds=30.0):
    async def solve():
        try:
            return await planner.solve(problem, seconds)
        finally:
            await planner.close()

    return asyncio.run(solve())


def test_one_action_at_a_time_proves_nothing_and_says_who_could():
    found = solved(PlannerProcess(), posed())
    assert isinstance(found, NoneFound)
    assert "no plan with one action at a time (unreachable: (mended f0), (mended f1))" in found.reason
    assert "engines that could do several: kairos" in found.reason


def test_in_a_race_without_an_engine_for_durations_it_is_the_same():
    race = PlannerRace(choose=lambda problem: [engine("pyperplan")] if not problem.features else [])
    assert isinstance(solved(race, posed()), NoneFound)
    assert isinstance(solved(PlannerProcess(), posed(matches=0)), ProvenUnsolvable)


def fake_aries(monkeypatch, *answers):
    monkeypatch.setattr(planner_module, "can_time", lambda name: name == "fake")
    return fake(answering(*answers))


def test_an_engines_schedule_becomes_a_plan(monkeypatch):
    problem = posed("(mended f0)", matches=1)
    timed = [list(one) for one in indices(problem.timed, *MENDED)]
    found = solved(fake_aries(monkeypatch, f'{{"timed": {timed}}}'), problem)
    assert isinstance(found, PlanFound)
    assert (found.plan, found.cost) == (schedule(*MENDED), 5.0)


@pytest.mark.parametrize(
    "answer",
    ['{"timed": [[0, 0.0, 5.0]]}', '{"timed": [[99, 0, 5]]}', '{"timed": [[0]]}', '{"timed": 3}', '{"actions": [0]}',
     '{"timed": [[0, NaN, 5]]}', '{"timed": [["0", 0, 5]]}'],
)  # fmt: skip
def test_a_schedule_that_is_none_is_the_engines_failure(monkeypatch, answer):
    found = solved(fake_aries(monkeypatch, answer), posed("(mended f0)", matches=1))
    assert isinstance(found, EngineFailed)


needs_aries = pytest.mark.skipif(bool(engine("aries").lacks()), reason=f"aries: {engine('aries').lacks()}")


@needs_aries
@pytest.mark.parametrize("make", [PlannerRace, lambda: PlannerProcess("aries")])
def test_aries_finds_a_plan_with_two_actions_at_once(make):
    world, goal = cellar(2, 2, burns=4.5), parse_condition(GOAL)
    found = solved(make(), build_problem(DOMAIN, world, goal, durations=True))
    assert isinstance(found, PlanFound), found
    assert validate(found.plan, DOMAIN, world, goal).valid
    assert found.cost == found.plan.seconds == max(one.end for one in found.plan.schedule)


class Fixed:
    """A planner with one answer."""

    def __init__(self, plan):
        self.plan = plan

    async def solve(self, problem, seconds):
        return PlanFound(self.plan, "fixed", 0.0, 0.1)


def test_a_robot_says_that_it_cannot_carry_out_what_needs_two_at_once():
    domain = PlanningDomain.parse(CELLAR)
    with Robot(domain, [], [], cellar(1, 1), planner=Fixed(schedule(*MENDED)), clock="simulated") as robot:
        end = robot.achieve(GOAL)
    [outcome] = end.emitted
    assert outcome.name == "no_plan"
    assert "concurrent steps that need each other" in outcome.attributes["reason"]


FLAT = """(define (domain flat) (:predicates (p) (q) (r))
  (:durative-action a :duration (= ?duration 2) :condition (and (at start START) (over all ALL) (at end END))
    :effect (and (at start BEGUN) (at end ENDED)))
  (:durative-action b :duration (= ?duration 2) :condition (at start (or (p) (not (q)))) :effect (at end (r))))"""
LITERALS = st.sampled_from(["(p)", "(q)", "(not (p))", "(not (q))", "(r)", "(not (r))"])
CONDITIONS = LITERALS | st.lists(LITERALS, max_size=2).map(lambda some: f"(or (p) {' '.join(some)})")
EFFECTS = LITERALS | st.tuples(LITERALS, LITERALS).map(lambda two: "(when {} {})".format(*two))


TIMES = (
    [("a", 0.0)], [("b", 0.0)], [("a", 0.0), ("b", 1.0)], [("b", 0.0), ("a", 0.5)], [("a", 0.0), ("b", 0.0)],
    [("a", 0.0), ("b", 2.0)], [("a", 0.0), ("a", 2.5)],
)  # fmt: skip


@settings(derandomize=True, deadline=None, max_examples=150)
@given(CONDITIONS, LITERALS, CONDITIONS, EFFECTS, EFFECTS, st.sets(st.sampled_from("pqr")), LITERALS)
def test_ground_problem_and_domain_agree_on_every_schedule(start, over_all, end, begun, ended, facts, goal):
    """The two judges know nothing of each other; what is not posed with durations is not compared."""
    text = FLAT.replace("START", start).replace("ALL", over_all).replace("BEGUN", begun).replace("ENDED", ended)
    domain = PlanningDomain.parse(text.replace("END", end).replace(":duration", ":parameters () :duration"))
    world = KnowledgeBase(domain.schema)
    world.apply(Delta(added=tuple(map(fact, sorted(facts)))), author="test")
    problem = build_problem(domain, world, parse_condition(goal), durations=True).timed
    if problem is None:
        return
    known: dict[str, list[int]] = {}
    for number, action in enumerate(problem.actions):
        known.setdefault(action.step.action, []).append(number)
    for timed in TIMES:
        if not known.keys() >= {name for name, _ in timed}:  # one does not matter for the goal, or cannot be taken
            continue
        plan = schedule(*((name, at, 2.0) for name, at in timed))
        ways = itertools.product(*(known[name] for name, _ in timed))
        ground = [
            problem.scheduled([(n, at, 2.0) for n, (_, at) in zip(chosen, timed, strict=True)]) for chosen in ways
        ]
        assert validate(plan, domain, world, parse_condition(goal)).valid == any(
            isinstance(one, Plan) for one in ground
        )
