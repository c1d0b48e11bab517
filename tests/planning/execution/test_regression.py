"""Regression against execution: what is needed before a plan holds exactly where the plan, carried out, reaches the goal."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_base import Delta, KnowledgeBase, Schema, fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax.expression import And, Atom, Comparison, Constant, Not, Or, Variable
from knowledge_base.language.syntax.text import parse_condition, to_text
from planning import Plan, PlanningDomain, PlanStep, validate
from planning.execution.regression import CausalNeeds, conjunction, disjunction

DOMAIN = PlanningDomain.parse("""
(define (domain everything)
  (:types box - object crate - box)
  (:predicates (open ?b - box) (in ?a ?b - box) (lit))
  (:functions (weight ?b - box) (total))
  (:action shut :parameters (?b - box) :precondition (open ?b) :effect (not (open ?b)))
  (:action unpack :parameters (?b - box) :precondition (or (open ?b) (lit))
    :effect (and (forall (?i - box) (when (in ?i ?b) (and (not (in ?i ?b)) (open ?i)))) (lit)))
  (:action put :parameters (?a ?b - box) :precondition (and (not (= ?a ?b)) (not (exists (?c - box) (in ?a ?c))))
    :effect (and (in ?a ?b) (increase (weight ?b) 1) (increase (total) (weight ?a))))
  (:action darken :parameters () :precondition (forall (?i - crate) (imply (open ?i) (lit)))
    :effect (and (when (lit) (not (lit))) (forall (?i - crate) (assign (weight ?i) 0)))))
""")
GOALS = (
    "(forall (?i - box) (open ?i))",
    "(exists (?i - box) (and (in ?i a) (not (open ?i))))",
    "(and (lit) (forall (?i - box) (imply (in ?i b) (exists (?j - crate) (in ?j ?i)))))",
    "(> (weight a) (weight b))",
    "(or (< (total) 2) (exists (?b - box) (> (weight ?b) 1)))",
    "(and (open a) (not (lit)))",
)
NAMES = ("a", "b", "c")
FACTS = [fact("lit"), *(fact("open", a) for a in NAMES), *(fact("in", a, b) for a in NAMES for b in NAMES)]
STEPS = [
    PlanStep("darken"),
    *(PlanStep(action, (a,)) for action in ("shut", "unpack") for a in NAMES),
    *(PlanStep("put", (a, b)) for a in NAMES for b in NAMES),
]


def needed_before(steps, goal, domain=DOMAIN):
    return CausalNeeds(steps, domain, goal).before(tuple(range(1, len(steps) + 1)))


def a_world(facts=(), weights=(0, 0, 0), total=0):
    kb = KnowledgeBase(DOMAIN.schema)
    values = {fact("weight", name): float(w) for name, w in zip(NAMES, weights, strict=True)}
    nodes = {"a": "box", "b": "crate", "c": "crate"}
    kb.apply(Delta(nodes=nodes, added=tuple(facts), values={**values, fact("total"): float(total)}), "test")
    return kb


@settings(derandomize=True, deadline=None, max_examples=300)
@given(
    facts=st.sets(st.sampled_from(FACTS)),
    weights=st.tuples(*[st.integers(0, 2)] * 3),
    steps=st.lists(st.sampled_from(STEPS), max_size=5),
    goal=st.sampled_from(GOALS),
)
def test_the_needs_of_a_plan_hold_exactly_where_the_plan_is_valid(facts, weights, steps, goal):
    world = a_world(facts, weights)
    wanted = parse_condition(goal)
    needed = needed_before(steps, wanted)
    assert all(holds(one, world) for one in needed) == validate(Plan(tuple(steps)), DOMAIN, world, wanted).valid


def needs(goal, *steps):
    found = needed_before(steps, parse_condition(goal))
    return {to_text(one): user for one, user in found.items()}


def test_a_part_is_needed_by_the_first_step_that_needs_it_or_by_the_goal():
    found = needs("(and (lit) (open c))", PlanStep("shut", ("a",)), PlanStep("shut", ("b",)))
    assert found["(open a)"] == 1
    assert found["(open b)"] == 2
    assert found["(lit)"] == found["(open c)"] == 3


def test_a_fact_that_a_step_adds_is_not_needed_before_it():
    assert needs("(and (lit) (open c))", PlanStep("unpack", ("b",))).keys() >= {"(or (open b) (lit))"}
    assert "(lit)" not in needs("(and (lit) (open c))", PlanStep("unpack", ("b",)))


def test_a_quantified_goal_is_not_grounded_so_that_things_yet_unknown_count():
    world = a_world([fact("open", "a"), fact("in", "b", "a"), fact("in", "c", "a")])
    needed = needed_before([PlanStep("unpack", ("a",))], parse_condition(GOALS[0]))
    assert all(holds(one, world) for one in needed)
    world.apply(Delta(nodes={"d": "box"}), "somebody")
    assert not all(holds(one, world) for one in needed)


@pytest.mark.parametrize("goal", ["(> (weight a) 1)", "(exists (?i - box) (> (weight ?i) 1))"])
def test_a_number_that_changes_for_many_things_by_an_amount_of_their_own_cannot_be_taken_back(goal):
    domain = PlanningDomain.parse("""
    (define (domain growing) (:types box) (:functions (weight ?b - box))
      (:action double :parameters () :effect (forall (?b - box) (increase (weight ?b) (weight ?b)))))
    """)
    assert needed_before([PlanStep("double")], parse_condition(goal), domain) is None


ROLLOUT = PlanningDomain.parse("""
(define (domain rollout)
  (:types server)
  (:predicates (in-pool ?s - server) (new ?s - server))
  (:action drain :parameters (?s - server) :precondition (in-pool ?s) :effect (not (in-pool ?s)))
  (:action install :parameters (?s - server) :precondition (not (in-pool ?s)) :effect (new ?s))
  (:action admit :parameters (?s - server) :precondition (not (in-pool ?s)) :effect (in-pool ?s)))
""")


@pytest.mark.parametrize("servers", [3, 40, 400])
def test_a_quantified_goal_of_a_long_plan_is_regressed(servers):
    steps = [PlanStep(name, (f"s{n}",)) for n in range(servers) for name in ("drain", "install", "admit")]
    goal = parse_condition("(forall (?s - server) (and (in-pool ?s) (new ?s)))")
    before = CausalNeeds(steps, ROLLOUT, goal).before(tuple(range(1, len(steps) + 1)))
    knowledge = KnowledgeBase(ROLLOUT.schema)
    names = {f"s{n}": "server" for n in range(servers)}
    knowledge.apply(Delta(nodes=names, added=tuple(fact("in-pool", one) for one in names)), author="me")
    assert all(holds(condition, knowledge) for condition in before)
    knowledge.apply(Delta(nodes={"new": "server"}), author="me")
    assert not all(holds(condition, knowledge) for condition in before)


TOUR = PlanningDomain.parse("""
(define (domain tour)
  (:types robot place) (:constants a b - place)
  (:predicates (at ?r - robot ?p - place))
  (:action move :parameters (?r - robot ?a ?b - place) :precondition (at ?r ?a)
    :effect (and (not (at ?r ?a)) (at ?r ?b))))
""")


def test_a_quantified_goal_of_many_moves_stays_shallow():
    steps = [PlanStep("move", ("r", *pair)) for _ in range(200) for pair in ("ab", "ba")]
    (condition,) = [
        one
        for one in CausalNeeds(steps, TOUR, parse_condition("(forall (?r - robot) (at ?r a))")).before(
            tuple(range(1, len(steps) + 1))
        )
        if "forall" in to_text(one)
    ]
    assert len(to_text(condition)) < 400


TANK = PlanningDomain.parse("""
(define (domain tank) (:functions (level) (rate))
  (:action fill :parameters () :effect (increase (level) (rate))))
""")


@pytest.mark.parametrize(("steps", "readable"), [(90, True), (120, False)])
def test_a_need_that_is_too_deep_for_a_query(steps, readable):
    """The plan is then validated as a whole at each change; see `CausalNeeds.before`."""
    found = needed_before([PlanStep("fill")] * steps, parse_condition("(> (level) 1)"), TANK)
    assert (found is not None) is readable


EQUALITIES = st.builds(
    Comparison, st.just("="), st.sampled_from([Variable("x"), Variable("y")]), st.sampled_from([*map(Constant, "ab")])
)
LITERALS = EQUALITIES | EQUALITIES.map(Not) | st.sampled_from([Atom("lit", (Variable("x"),)), Atom("on", ())])
CONDITIONS = st.recursive(
    LITERALS,
    lambda inner: st.builds(
        lambda kind, parts: kind(tuple(parts)), st.sampled_from([And, Or]), st.lists(inner, min_size=1, max_size=4)
    ),
    max_leaves=12,
)
LAMPS = Schema.parse("(define (domain d) (:types lamp) (:predicates (lit ?l - lamp) (on)))")


@given(st.lists(CONDITIONS, min_size=1, max_size=4), st.sets(st.sampled_from([fact("on"), fact("lit", "a")])))
def test_a_simplified_condition_is_true_in_the_same_worlds(parts, told):
    world = KnowledgeBase(LAMPS)
    world.apply(Delta(nodes=dict.fromkeys("ab", "lamp"), added=tuple(told)), author="me")
    for bindings in ({"x": one, "y": other} for one in "ab" for other in "ab"):
        for join, simplified in ((And, conjunction), (Or, disjunction)):
            assert holds(simplified(parts), world, bindings) == holds(join(tuple(parts)), world, bindings)
