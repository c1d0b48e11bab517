"""Numbers that actions change, and costs: posed, searched by the book, and solved by real engines."""

from __future__ import annotations

import json
import shutil

import pytest
from searching import breadth_first, cheapest, solution

from knowledge_base.facts import Delta, fact
from knowledge_base.language.syntax.text import parse_condition, parse_term
from knowledge_base.pddl.problem_text import Metric
from knowledge_base.store import KnowledgeBase
from planning.analysis.explanation import why_unsolvable
from planning.analysis.validation import validate
from planning.engines.request import read, write_problem
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep
from planning.model.problem import UnsupportedActionError, UnsupportedGoalError
from planning.model.quantities import Assignment, NumericBound, Operation, linear, text
from planning.problem.construction import build_problem

JARS = """(define (domain jars)
  (:types jar)
  (:predicates (sealed ?j - jar) (named ?n - number))
  (:functions (litres ?j - jar) (holds-at-most ?j - jar) (poured))
  (:action fill :parameters (?j - jar) :precondition (not (sealed ?j))
    :effect (and (assign (litres ?j) (holds-at-most ?j)) (increase (poured) 1)))
  (:action empty :parameters (?j - jar) :effect (assign (litres ?j) 0))
  (:action pour :parameters (?a ?b - jar)
    :precondition (and (!= ?a ?b) (not (sealed ?b)) (<= (+ (litres ?a) (litres ?b)) (holds-at-most ?b)))
    :effect (and (increase (litres ?b) (litres ?a)) (assign (litres ?a) 0) (increase (poured) 1)))
  (:action top-up :parameters (?a ?b - jar)
    :precondition (and (!= ?a ?b) (> (+ (litres ?a) (litres ?b)) (holds-at-most ?b)))
    :effect (and (assign (litres ?b) (holds-at-most ?b)) (increase (poured) 1)
                 (decrease (litres ?a) (- (holds-at-most ?b) (litres ?b)))))
  (:action seal :parameters (?j - jar) :precondition (= (litres ?j) 4) :effect (sealed ?j)))
"""


@pytest.fixture(scope="module")
def jars():
    return PlanningDomain.parse(JARS, "jars.pddl")


def kitchen(domain, *facts):
    kb = KnowledgeBase(domain.schema)
    sizes = {fact("holds-at-most", "big"): 5, fact("holds-at-most", "small"): 3}
    kb.apply(Delta(nodes={"big": "jar", "small": "jar"}, added=facts, values=sizes), author="test")
    return kb


def found(domain, world, goal, search=breadth_first):
    wanted = parse_condition(goal)
    plan = solution(build_problem(domain, world, wanted), search)
    assert plan is None or validate(plan, domain, world, wanted).valid
    return plan


# ---- grounded ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("goal", "steps"),
    [
        ("(= (litres big) 4)", 6),
        ("(sealed big)", 7),
        ("(and (= (litres big) 2) (> (litres small) 1))", 2),
        ("(or (= (litres big) 4) (= (litres small) 3))", 1),
        ("(not (= (litres big) 0))", 1),
        ("(!= (litres big) (litres small))", 1),
        ("(exists (?j - jar) (and (!= ?j big) (>= (* 2 (litres ?j)) (litres big)) (> (litres ?j) 0)))", 1),
        ("(not (< (poured) 2))", 2),
        ("(and (> (litres big) 0) (< (litres big) 3))", 2),
    ],
)
def test_goals_about_numbers_are_reached(jars, goal, steps):
    assert len(found(jars, kitchen(jars), goal).steps) == steps


def test_a_number_that_no_action_changes_is_replaced_by_its_value(jars):
    problem = build_problem(jars, kitchen(jars), parse_condition("(= (litres big) 4)"))
    bounds = {str(bound) for action in problem.actions for bound in action.bounds}
    assert "(<= (+ (litres big) (litres small)) 3)" in bounds
    assert problem.features == {"numeric"}
    assert problem.numbers == {fact("litres", "big"): 0, fact("litres", "small"): 0}


def test_a_number_that_nobody_asks_about_is_left_out(jars):
    problem = build_problem(jars, kitchen(jars), parse_condition("(sealed big)"))
    assert fact("poured") not in {one.fluent for action in problem.actions for one in action.assignments}


def test_a_numeric_problem_is_json_and_back(jars):
    problem = build_problem(jars, kitchen(jars), parse_condition("(and (sealed big) (> (poured) 3))"))
    assert read(json.loads(write_problem(problem))) == problem


def test_a_number_that_no_possible_action_changes_is_proven_out_of_reach(jars):
    world = kitchen(jars, fact("sealed", "big"), fact("sealed", "small"))
    goal = parse_condition("(> (poured) 0)")
    assert build_problem(jars, world, goal).unreachable == ()  # topping up is possible as far as relaxation sees
    closed = PlanningDomain.parse(JARS.replace("(:action top-up", "(:action never").replace(
        "(> (+ (litres ?a)", "(< 1 0) (> (+ (litres ?a)"))  # fmt: skip
    world = kitchen(closed, fact("sealed", "big"), fact("sealed", "small"))
    assert build_problem(closed, world, goal).unreachable == ("(> (poured) 0)",)
    [why] = why_unsolvable(closed, world, goal)
    assert why == "(> (poured) 0) cannot hold: (poured) is 0"


def test_an_explanation_names_the_number_that_an_action_lacks(jars):
    domain = PlanningDomain.parse("""(define (domain d) (:types lamp) (:predicates (on ?l - lamp) (wired))
      (:functions (charge))
      (:action load :precondition (wired) :effect (increase (charge) 1))
      (:action press :parameters (?l - lamp) :precondition (> (charge) 3) :effect (on ?l)))""")
    world = KnowledgeBase(domain.schema)
    world.apply(Delta(nodes={"l1": "lamp"}), author="test")
    assert why_unsolvable(domain, world, parse_condition("(on l1)")) == (
        "(on l1) needs (press l1), which needs (> (charge) 3), but (charge) is 0",
    )


def test_a_fact_about_a_changing_number_is_named(jars):
    with pytest.raises(UnsupportedGoalError, match=r"\(poured\)"):
        build_problem(jars, kitchen(jars), parse_condition("(and (named (poured)) (> (poured) 1))"))


def test_two_assignments_of_one_number_are_named():
    domain = PlanningDomain.parse(
        """(define (domain d) (:functions (f))
  (:action a :effect (and (assign (f) 1) (increase (f) 2))))""", "d.pddl")  # fmt: skip
    with pytest.raises(UnsupportedActionError, match=r"'a' changes \(f\) in two ways") as caught:
        build_problem(domain, KnowledgeBase(domain.schema), parse_condition("(> (f) 1)"))
    assert caught.value.place.line == 2


def test_increases_in_one_effect_add_up():
    domain = PlanningDomain.parse("""(define (domain d) (:functions (f))
      (:action a :effect (and (increase (f) 1) (increase (f) 2) (decrease (f) 0.5))))""")
    problem = build_problem(domain, KnowledgeBase(domain.schema), parse_condition("(= (f) 5)"))
    assert problem.plan([0, 0]).steps == (PlanStep("a"),) * 2
    said = problem.plan([0])
    assert isinstance(said, str)
    assert "(= (f) 5)" in said


def test_a_conditional_change_happens_only_when_its_condition_holds():
    domain = PlanningDomain.parse("""(define (domain d) (:predicates (wet)) (:functions (f))
      (:action a :effect (when (< (f) 2) (increase (f) 1)))
      (:action b :effect (when (>= (f) 2) (wet))))""")
    plan = found(domain, KnowledgeBase(domain.schema), "(wet)")
    assert [step.action for step in plan.steps] == ["a", "a", "b"]


def test_a_plan_that_divides_by_zero_is_no_solution():
    domain = PlanningDomain.parse("""(define (domain d) (:functions (f) (g))
      (:action a :effect (assign (f) (/ 1 (g)))) (:action b :effect (increase (g) 1)))""")
    problem = build_problem(domain, KnowledgeBase(domain.schema), parse_condition("(> (f) 0)"))
    names = [action.step.action for action in problem.actions]
    said = problem.plan([names.index("a")])
    assert isinstance(said, str)
    assert "cannot be computed" in said
    assert problem.plan([names.index("b"), names.index("a")]).steps


# ---- quantities ------------------------------------------------------------------------------------------


def test_a_bound_is_written_as_in_pddl():
    bound = NumericBound(">=", Operation("-", (Operation("*", (2, fact("fuel", "t1"))), 1.5)), fact("least"))
    assert str(bound) == "(>= (- (* 2 (fuel t1)) 1.5) (least))"


@pytest.mark.parametrize(
    ("quantity", "coefficients"),
    [
        (fact("f"), {"(f)": 1}),
        (Operation("+", (fact("f"), 3, Operation("*", (2, fact("g"), 4)))), {"(f)": 1, "(g)": 8}),
        (Operation("-", (fact("f"), Operation("/", (fact("f"), 4)))), {"(f)": 0.75}),
        (Operation("-", (fact("f"),)), {"(f)": -1}),
        (Operation("*", (fact("f"), fact("g"))), None),
        (Operation("/", (2, fact("f"))), None),
    ],
)
def test_sums_of_fluents_are_recognised(quantity, coefficients):
    found = linear(quantity)
    assert (None if found is None else {text(one): value for one, value in found.items()}) == coefficients


def test_assignments_are_computed_from_the_numbers_before():
    double = Assignment(fact("f"), Operation("*", (2, fact("f"))), increase=False)
    assert double.result({fact("f"): 4}) == 8
    assert Assignment(fact("f"), fact("f"), increase=True).result({fact("f"): 4}) == 8


# ---- costs -----------------------------------------------------------------------------------------------

ROADS = """(define (domain roads) (:requirements :action-costs) (:types place)
  (:predicates (at ?p - place) (road ?a ?b - place) (paid))
  (:functions (total-cost) (length ?a ?b - place) (tolls) (speed))
  (:action go :parameters (?a ?b - place) :precondition (and (at ?a) (road ?a ?b))
    :effect (and (not (at ?a)) (at ?b) (increase (total-cost) (length ?a ?b))
                 (when (not (paid)) (increase (tolls) 3))))
  (:action pay :effect (and (paid) (increase (total-cost) 4) (decrease (speed) 1))))
"""


def roads() -> tuple[PlanningDomain, KnowledgeBase]:
    domain = PlanningDomain.parse(ROADS)
    kb = KnowledgeBase(domain.schema)
    lengths = {("a", "b"): 10, ("a", "c"): 2, ("c", "d"): 2, ("d", "b"): 2.5}
    kb.apply(
        Delta(
            nodes=dict.fromkeys("abcd", "place"),
            added=(fact("at", "a"), *(fact("road", *pair) for pair in lengths)),
            values={fact("length", *pair): length for pair, length in lengths.items()},
        ),
        author="test",
    )
    return domain, kb


def cheap(text):
    return Metric("minimize", parse_term(text))


def there(problem, search):
    chosen = search(problem)
    return problem.cost(chosen), [step.action for step in problem.plan(chosen).steps]


def test_total_cost_is_the_cost_of_each_action():
    problem = build_problem(*roads(), parse_condition("(at b)"))
    assert problem.features == {"costs"}
    assert there(problem, breadth_first) == (10, ["go"])
    assert there(problem, cheapest) == (6.5, ["go"] * 3)


def test_a_metric_is_a_sum_of_what_actions_raise():
    domain, world = roads()
    problem = build_problem(domain, world, parse_condition("(at b)"), cheap("(+ (* 3 (total-cost)) (tolls) 7)"))
    assert there(problem, cheapest) == (28.5, ["go"] * 3)
    problem = build_problem(domain, world, parse_condition("(at b)"), cheap("(+ (* 2 (total-cost)) (tolls))"))
    assert there(problem, cheapest) == (21.0, ["pay", "go", "go", "go"])


def test_to_maximize_is_to_minimize_the_opposite():
    domain, world = roads()
    slow = Metric("maximize", parse_term("(- (total-cost))"))
    goal = parse_condition("(at b)")
    assert build_problem(domain, world, goal, slow) == build_problem(domain, world, goal)


@pytest.mark.parametrize("metric", ["(* (tolls) (total-cost))", "(speed)", "(total-time)"])
def test_a_metric_that_is_no_cost_is_ignored_and_said(metric):
    problem = build_problem(*roads(), parse_condition("(and (at b) (paid))"), cheap(metric))
    assert problem.features == frozenset()
    assert metric in problem.notes[0]
    assert {action.cost for action in problem.actions} == {1.0}


def test_costs_neither_add_actions_nor_numbers():
    problem = build_problem(*roads(), parse_condition("(at b)"))
    assert {action.step.action for action in problem.actions} == {"go"}
    assert problem.numbers == {}


# ---- real engines ----------------------------------------------------------------------------------------


def planned(problem, engine):
    """The plan that an engine of unified-planning finds for the translated problem, as action numbers."""
    from unified_planning.shortcuts import get_environment

    from planning.engines.up import translated

    factory = get_environment().factory
    if engine not in factory.engines:
        pytest.skip(f"{engine} is not installed")
    if engine.startswith("enhsp") and shutil.which("java") is None:
        pytest.skip("ENHSP needs Java")
    get_environment().credits_stream = None
    translation = translated(problem, costs="costs" in problem.features, environment=get_environment())
    result = factory.engine(engine)().solve(translation, timeout=60)
    return result.plan and [int(step.action.name[1:]) for step in result.plan.actions]


@pytest.mark.parametrize("goal", ["(sealed big)", "(and (= (litres big) 2) (> (* 2 (litres small)) 1.5))"])
def test_enhsp_solves_what_was_posed(jars, goal):
    world, wanted = kitchen(jars), parse_condition(goal)
    problem = build_problem(jars, world, wanted)
    plan = problem.plan(planned(problem, "enhsp"))
    assert isinstance(plan, Plan)
    assert validate(plan, jars, world, wanted).valid


@pytest.mark.parametrize("engine", ["fast-downward-opt", "enhsp-opt"])
def test_optimal_engines_find_cheapest_plans(engine):
    problem = build_problem(*roads(), parse_condition("(at b)"))
    assert problem.cost(planned(problem, engine)) == 6.5
