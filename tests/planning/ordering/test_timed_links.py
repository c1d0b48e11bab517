from __future__ import annotations

import pytest

from knowledge_base.errors import InputError
from knowledge_base.facts import fact
from knowledge_base.language.syntax.text import parse_condition
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep, Timing
from planning.ordering.partial_order import why
from planning.ordering.timed_links import linked

CELLAR = PlanningDomain.parse("""
(define (domain cellar) (:types match fuse)
  (:predicates (unused ?m - match) (light ?m - match) (free) (mended ?f - fuse) (open) (shut) (aired))
  (:durative-action strike :parameters (?m - match) :duration (= ?duration 5)
    :condition (and (at start (unused ?m)) (over all (light ?m)))
    :effect (and (at start (light ?m)) (at start (not (unused ?m))) (at end (not (light ?m)))))
  (:durative-action mend :parameters (?f - fuse ?m - match) :duration (= ?duration 2)
    :condition (and (at start (free)) (over all (light ?m)))
    :effect (and (at start (not (free))) (at end (mended ?f)) (at end (free))))
  (:durative-action air :parameters () :duration (= ?duration 4)
    :condition (at end (open)) :effect (at end (aired)))
  (:action unlatch :parameters () :precondition (shut) :effect (and (open) (not (shut)))))
""")


@pytest.fixture
def cellar(world_of):
    facts = (fact("unused", "m"), fact("free"), fact("shut"))
    return world_of(CELLAR.schema, {"m": "match", "f": "fuse", "g": "fuse"}, facts)


def timed(*steps):
    rows = [(text.split(), start, seconds) for text, start, seconds in steps]
    return Plan(
        tuple(PlanStep(name, tuple(args)) for (name, *args), _, _ in rows),
        tuple(Timing(start, seconds) for _, start, seconds in rows),
    )


MENDING = timed(("strike m", 0, 5), ("mend f m", 0, 2), ("mend g m", 2.5, 2))


def test_an_over_all_condition_is_provided_by_a_running_step(cellar):
    order = linked(MENDING, CELLAR, cellar, parse_condition("(and (mended f) (mended g))"))
    assert list(map(str, order.links)) == [
        "0 -(unused m)-> 1", "0 -(free)-> 2", "1 -(light m)-> 2", "1 -(light m)-> 3", "2 -(free)-> 3",
        "2 -(mended f)-> 4", "3 -(mended g)-> 4",
    ]  # fmt: skip
    assert (order.before, order.begin_before) == (frozenset({(2, 3)}), frozenset({(1, 3)}))


def test_a_later_step_may_provide_what_an_earlier_one_needs_at_its_end(cellar):
    plan, goal = timed(("air", 0, 4), ("unlatch", 1, 0)), parse_condition("(aired)")
    order = linked(plan, CELLAR, cellar, goal)
    assert [str(link) for link in order.links if link.provider] == ["2 -(open)-> 1", "1 -(aired)-> 3"]
    assert [str(why(order, number)) for number in (1, 2)] == [
        "1 (air): (aired) for the goal", "2 (unlatch): (open) for step 1; serves (aired)",
    ]  # fmt: skip


def test_a_schedule_that_does_not_lead_to_the_goal_has_no_links(cellar):
    late = timed(("strike m", 0, 5), ("mend f m", 6, 2))
    with pytest.raises(InputError, match=r"\(mend f m\) needs \(light m\)"):
        linked(late, CELLAR, cellar, parse_condition("(mended f)"))
    with pytest.raises(InputError, match=r"the goal needs \(aired\)"):
        linked(MENDING, CELLAR, cellar, parse_condition("(and (mended g) (aired))"))


ROAD = PlanningDomain.parse("""
(define (domain road) (:types place)
  (:predicates (at ?p - place)) (:functions (fuel) (level))
  (:durative-action drive :parameters (?a ?b - place) :duration (= ?duration 2)
    :condition (and (at start (at ?a)) (at start (>= (fuel) 3)) (over all (>= (fuel) 0)))
    :effect (and (at start (not (at ?a))) (at start (decrease (fuel) 3)) (at end (at ?b))))
  (:durative-action fill :parameters () :duration (= ?duration 1) :effect (at end (increase (fuel) 5)))
  (:action drain :parameters () :effect (assign (fuel) 0)))
""")


@pytest.fixture
def road(world_of):
    return world_of(ROAD.schema, dict.fromkeys("abc", "place"), (fact("at", "a"),), {fact("fuel"): 4})


def fuel_links(plan, world):
    links = linked(plan, ROAD, world, parse_condition("(at c)")).links
    return [str(link) for link in links if "fuel" in str(link)]


def test_a_step_that_decreases_a_number_does_not_provide_the_remainder(road):
    plan = timed(("drive a b", 0, 2), ("fill", 2.5, 1), ("drive b c", 4, 2))
    assert fuel_links(plan, road) == [
        "0 -(>= (fuel) 3)-> 1", "0 -(>= (fuel) 0)-> 1", "2 -(>= (fuel) 3)-> 3", "2 -(>= (fuel) 0)-> 3",
    ]  # fmt: skip


def test_a_decrease_at_the_moment_of_an_increase_does_not_provide_the_number(road):
    plan = timed(("fill", 0, 1), ("drive a b", 1, 2), ("fill", 3, 1), ("drive b c", 4.5, 2))
    assert [link for link in fuel_links(plan, road) if link.endswith("-> 4")] == [
        "1 -(>= (fuel) 3)-> 4", "1 -(>= (fuel) 0)-> 4", "3 -(>= (fuel) 3)-> 4", "3 -(>= (fuel) 0)-> 4",
    ]  # fmt: skip


def test_once_a_number_was_set_all_who_changed_it_provide_it(road):
    plan = timed(("drain", 0, 0), ("fill", 1, 1), ("drive a b", 3, 2), ("fill", 5.5, 1), ("drive b c", 7, 2))
    assert [link for link in fuel_links(plan, road) if link.endswith("-> 5")] == [
        "1 -(>= (fuel) 3)-> 5", "2 -(>= (fuel) 3)-> 5", "3 -(>= (fuel) 3)-> 5", "4 -(>= (fuel) 3)-> 5",
    ]  # fmt: skip
