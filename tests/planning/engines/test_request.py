"""The request of a search: a worker reads the problem that was written."""

from __future__ import annotations

import json
from operator import attrgetter

from hypothesis import given
from hypothesis import strategies as st

from knowledge_base.facts import Fact
from planning.engines.request import read, write_problem
from planning.model.ground_action import ActionSpan, GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem
from planning.model.quantities import Assignment, NumericBound, Operation

NAMES = st.sampled_from(["cup", "50% full", "%d", 'quoted "name"', "a-b"])
FACTS = st.builds(Fact, NAMES, st.lists(NAMES | st.integers(-2, 2), max_size=2).map(tuple))
SOME = st.lists(FACTS, max_size=3).map(tuple)
NUMBERS = st.integers(-3, 3) | st.floats(-9, 9)
QUANTITIES = st.recursive(
    NUMBERS | FACTS,
    lambda inner: st.builds(Operation, st.sampled_from("+-*/"), st.lists(inner, min_size=1, max_size=2).map(tuple)),
    max_leaves=4,
)
BOUNDS = st.lists(st.builds(NumericBound, st.sampled_from(["<", ">=", "="]), QUANTITIES, QUANTITIES), max_size=2)
STEPS = st.none() | st.builds(PlanStep, NAMES, st.lists(NAMES, max_size=2).map(tuple))
ACTIONS = st.builds(
    GroundAction,
    STEPS,
    SOME,
    SOME,
    SOME,
    st.integers(0, 3) | st.floats(0, 9),
    BOUNDS.map(tuple),
    st.lists(st.builds(Assignment, FACTS, QUANTITIES, st.booleans()), max_size=2).map(tuple),
    st.none() | st.builds(ActionSpan, st.floats(0, 9), st.floats(0, 9), SOME, SOME, SOME, SOME),
)
TEXTS = st.lists(NAMES, max_size=2).map(tuple)
PROBLEMS = st.builds(
    Problem,
    NAMES,
    st.dictionaries(NAMES, NAMES, max_size=2),
    SOME,
    SOME,
    st.lists(ACTIONS, max_size=3).map(tuple),
    TEXTS,
    numbers=st.dictionaries(FACTS, NUMBERS, max_size=2),
    bounds=BOUNDS.map(tuple),
    notes=TEXTS,
    one_at_a_time=st.booleans(),
)


@given(PROBLEMS)
def test_a_worker_reads_the_problem_that_was_written(problem):
    line = write_problem(problem)
    assert line.count(b"\n") == 1
    again = read(json.loads(line))
    assert again == problem
    said = attrgetter("step", "cost", "bounds", "assignments", "span")
    assert list(map(said, again.actions)) == list(map(said, problem.actions))


@given(PROBLEMS, st.booleans())
def test_a_request_tells_whether_the_problem_is_a_part_of_another(problem, part):
    if part:
        problem = Problem(problem.domain, problem.objects, problem.init, problem.goal, (), unsliced=lambda: problem)
    assert json.loads(write_problem(problem))["whole"] is part
