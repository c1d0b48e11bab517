"""Ranges of numbers contain every value that a sequence of actions reaches."""

from __future__ import annotations

import random
from contextlib import suppress

import pytest

from knowledge_base.facts import Fact, fact
from knowledge_base.language.syntax.text import parse_condition
from planning.analysis.ranges import Ranges, reached_literals
from planning.model.domain import PlanningDomain
from planning.problem.construction import ProblemBuilder

STEPS = """(define (domain steps) (:predicates (on) (off)) (:functions (a) (b))
  (:action up :parameters () :precondition (<= (a) 4) :effect (and (increase (a) 3) (on)))
  (:action down :parameters () :precondition (and (on) (> (b) (a))) :effect (and (decrease (b) (a)) (off)))
  (:action swap :parameters () :precondition (off) :effect (assign (a) (- (b) (* 2 (a)))))
  (:action half :parameters () :precondition (>= (b) 1) :effect (assign (b) (/ (b) (+ (a) 1)))))"""


@pytest.mark.parametrize("seed", range(20))
def test_each_value_that_a_sequence_of_actions_reaches_is_in_its_range(world_of, seed):
    domain, chance = PlanningDomain.parse(STEPS), random.Random(seed)  # noqa: S311
    values = {fact("a"): chance.randint(-2, 3), fact("b"): chance.randint(-2, 9)}
    world = world_of(domain.schema, {}, (), values)
    task = ProblemBuilder(domain).grounded(world, parse_condition("(and (off) (> (a) 90) (> (b) 90))")).task
    assert task is not None
    ranges = Ranges(world)
    reached_literals(task, ranges)
    numbers, held = (
        dict[Fact, float](values),
        {str(task.numbering.facts[one]) for one in task.init if one not in task.numbering.bounds},
    )
    for _ in range(60):
        way = chance.choice(task.ways.all)
        bounds = [task.numbering.bounds[one] for one in way.needs if one in task.numbering.bounds]
        literals = {str(task.numbering.facts[one]) for one in way.needs if one not in task.numbering.bounds}
        if literals <= held and all(bound.holds(numbers) for bound in bounds):
            with suppress(ArithmeticError):
                numbers.update({change.fluent: change.result(numbers) for change in way.assignments})
            held |= {str(task.numbering.facts[one]) for one in way.adds if one not in task.numbering.fluents}
        for fluent, value in numbers.items():
            least, most = ranges.of(fluent)
            assert least <= value <= most, (fluent, value)
