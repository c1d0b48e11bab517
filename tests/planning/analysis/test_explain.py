from __future__ import annotations

import pytest

from knowledge_base.errors import UnknownNameError
from knowledge_base.facts import Delta, fact
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from planning.analysis.explanation import why_unsolvable
from planning.model.domain import PlanningDomain
from planning.problem.construction import build_problem

ALL_TIDY = parse_condition("(forall (?i - item) (tidy ?i))")


def without(world, *facts):
    world.apply(Delta(removed=facts), author="test")
    return world


@pytest.mark.parametrize(
    ("lost", "chain"),
    [
        (
            fact("graspable", "cup1"),
            ["(tidy cup1) needs", "(pick-up cup1 table), which needs (graspable cup1)"],
        ),
        (fact("passable", "bin"), ["(tidy crisp1) needs (throw-away crisp1 bin)", "needs (passable bin)"]),
        (fact("goes-to", "crisp1", "bin"), ["(tidy crisp1) needs", "no planning action makes it true"]),
        (fact("lies-at", "can1", "table"), ["(tidy can1) needs", "(holding can1) needs", "(lies-at can1"]),
    ],
)
def test_the_chain_ends_at_what_is_missing(clean_up, table, lost, chain):
    [why] = why_unsolvable(clean_up, without(table(2, 1, ["one"]), lost), ALL_TIDY)
    assert all(part in why for part in chain)


def test_every_unreachable_goal_fact_has_a_sentence(clean_up, table):
    world = without(table(3), fact("graspable", "cup1"), fact("graspable", "cup3"))
    assert [why.split(" needs")[0] for why in why_unsolvable(clean_up, world, ALL_TIDY)] == [
        "(tidy cup1)",
        "(tidy cup3)",
    ]


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        ("(missing cup1)", "(missing cup1) does not hold, and no planning action makes it true"),
        ("(not (seen cup1))", "(seen cup1) holds, and no planning action makes it false"),
        ("(or (missing cup1) (holding cup1))", "not all of them together"),
        ("(< 3 2)", "no planning action changes that"),
    ],
)
def test_goals_that_no_action_affects(clean_up, table, goal, why):
    assert why in why_unsolvable(clean_up, table(1), parse_condition(goal))[0]


def test_a_condition_that_cannot_change_is_named(world_of):
    domain = PlanningDomain.parse("""(define (domain d) (:types lamp) (:predicates (on ?l - lamp))
      (:functions (limit))
      (:action press :parameters (?l - lamp) :precondition (< 3 (limit)) :effect (on ?l)))""")
    [why] = why_unsolvable(domain, world_of(domain.schema, {"l1": "lamp"}), parse_condition("(on l1)"))
    assert why == "(on l1) needs (press l1), which needs (< 3 (limit)), here 3 < 0"


def test_a_typo_in_the_goal_is_an_error(clean_up, table):
    with pytest.raises(UnknownNameError, match="'tidy'"):
        why_unsolvable(clean_up, table(1), parse_condition("(tidi cup1)"))


def test_a_conditional_effect_needs_its_condition(world_of):
    domain = PlanningDomain.parse("""(define (domain lift) (:types person floor)
      (:predicates (at ?f - floor) (boarded ?p - person) (served ?p - person) (bound ?p - person ?f - floor))
      (:action stop :parameters (?f - floor) :precondition (at ?f) :effect
        (forall (?p - person) (when (and (boarded ?p) (bound ?p ?f)) (served ?p)))))""")
    world = world_of(domain.schema, {"ann": "person", "f1": "floor", "f2": "floor"})
    world.apply(Delta(added=(fact("at", "f2"), fact("bound", "ann", "f2"))), author="test")
    [why] = why_unsolvable(domain, world, parse_condition("(served ann)"))
    assert why == (
        "(served ann) needs (stop f2), which needs (boarded ann); "
        "(boarded ann) does not hold, and no planning action makes it true"
    )


BLOCKS = """(define (domain blocks) (:types block)
  (:predicates (on ?a ?b - block) (on-table ?a - block) (clear ?a - block))
  (:action lift :parameters (?a ?b - block) :precondition (and (clear ?a) (on-table ?a) (clear ?b) (not (= ?a ?b)))
    :effect (and (on ?a ?b) (not (on-table ?a)) (not (clear ?b))))
  (:action lower :parameters (?a ?b - block) :precondition (and (clear ?a) (on ?a ?b))
    :effect (and (not (on ?a ?b)) (on-table ?a) (clear ?b))))"""


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        ("(and (on a b) (on c b))", "(on a b) and (on c b) can never hold together"),
        ("(and (on a b) (clear b))", "(on a b) and (clear b) can never hold together"),
        ("(and (on a b) (not (on a b)))", "(on a b) and (not (on a b)) can never hold together"),
        ("(and (on a b) (on b c) (on c a))", "each goal fact can be reached by itself, but not all of them together"),
    ],
)
def test_goal_facts_that_exclude_each_other_are_named(world_of, goal, why):
    domain = PlanningDomain.parse(BLOCKS)
    facts = [fact(name, block) for name in ("on-table", "clear") for block in "abc"]
    world = world_of(domain.schema, dict.fromkeys("abc", "block"), facts)
    assert why_unsolvable(domain, world, parse_condition(goal)) == (why,)


def test_a_cycle_of_needed_steps_is_explained(world_of):
    domain = PlanningDomain.parse("""(define (domain d) (:predicates (empty) (full) (done))
      (:action take :parameters () :precondition (empty) :effect (and (full) (not (empty))))
      (:action put :parameters () :precondition (full) :effect (and (empty) (done) (not (full)))))""")
    [why] = why_unsolvable(domain, world_of(domain.schema, {}), parse_condition("(done)"))
    assert why == (
        "(done) needs (put), which needs (full); (full) needs (take), which needs (empty); (empty) needs (put), which"
        " needs (full); none of these can come first"
    )


@pytest.mark.parametrize(
    ("fuel", "goal", "why"),
    [
        (5, "(there)", "(there) needs (drive), which needs (>= (fuel) 7), but (fuel) is at most 5"),
        (9, "(> (fuel) 9)", "(> (fuel) 9) cannot hold: (fuel) is at most 9"),
    ],
)
def test_an_action_that_only_decreases_a_number_cannot_satisfy_a_lower_bound(world_of, fuel, goal, why):
    domain = PlanningDomain.parse("""(define (domain d) (:predicates (there)) (:functions (fuel))
      (:action drive :parameters () :precondition (>= (fuel) 7) :effect (and (there) (decrease (fuel) 7)))
      (:action idle :parameters () :effect (decrease (fuel) 1)))""")
    world, wanted = world_of(domain.schema, {}, (), {fact("fuel"): fuel}), parse_condition(goal)
    assert build_problem(domain, world, wanted).unreachable == (goal,)
    assert why_unsolvable(domain, world, wanted) == (why,)


TANK = """(define (domain tank) (:types tank) (:predicates (full ?t - tank)) (:functions (level ?t - tank) (fuel))
  (:action pour :parameters (?t - tank) :precondition (>= (fuel) 1)
    :effect (and (increase (level ?t) 1) (decrease (fuel) 1)))
  (:action close :parameters (?t - tank) :precondition (>= (level ?t) 3) :effect (full ?t)))"""


@pytest.mark.parametrize("goal", ["(>= (level a) 3)", "(full a)", "(and (>= (level a) 1) (>= (level b) 2))"])
def test_a_numeric_problem_does_not_claim_that_each_goal_fact_can_be_reached(world_of, goal):
    domain = PlanningDomain.parse(TANK)
    values = {fact("level", "a"): 0, fact("level", "b"): 0, fact("fuel"): 2}
    world = world_of(domain.schema, dict.fromkeys("ab", "tank"), values=values)
    why = why_unsolvable(domain, world, parse_condition(goal))
    assert len(why) == 1
    assert why[0].startswith("no plan reaches the goal with the numbers (fuel), (level a)")


SPRAYER = """(define (domain sprayer) (:types row) (:predicates (sprayed ?r - row) (at-depot))
  (:functions (tank) (capacity) (need ?r - row) (dose))
  (:action fill :parameters () :precondition (and (at-depot) (< (tank) (capacity))) :effect (assign (tank) (capacity)))
  (:action mix :parameters () :precondition (at-depot) :effect (assign (dose) (* 2 (capacity))))
  (:action dilute :parameters () :precondition (at-depot) :effect (assign (dose) (/ (dose) 2)))
  (:action spray :parameters (?r - row) :precondition (>= (tank) (need ?r))
    :effect (and (sprayed ?r) (decrease (tank) (need ?r)))))"""


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        ("(sprayed far)", "(sprayed far) needs (spray far), which needs (>= (tank) 500), but (tank) is at most 100"),
        ("(>= (tank) 150)", "(>= (tank) 150) cannot hold: (tank) is at most 100"),
        ("(> (dose) 200)", "(> (dose) 200) cannot hold: (dose) is at least 0 and at most 200"),
        ("(< (dose) 0)", "(< (dose) 0) cannot hold: (dose) is at least 0 and at most 200"),
        ("(and (sprayed near) (> (- (tank) (dose)) 100))", "(> (- (tank) (dose)) 100) cannot hold: (tank) is at most 100 and (dose) is at least 0 and at most 200"),
    ],
)  # fmt: skip
def test_the_limit_of_a_number_is_named(world_of, goal, why):
    domain = PlanningDomain.parse(SPRAYER)
    needs = {fact("need", "near"): 40, fact("need", "far"): 500}
    values = {fact("tank"): 30, fact("capacity"): 100, fact("dose"): 1, **needs}
    world = world_of(domain.schema, {"near": "row", "far": "row"}, (fact("at-depot"),), values)
    assert why_unsolvable(domain, world, parse_condition(goal)) == (why,)


def test_a_missing_fact_inside_a_condition_is_followed_to_its_cause():
    domain = PlanningDomain.parse("""(define (domain lab) (:types tube place) (:constants centrifuge camera rack - place)
      (:predicates (at ?t - tube ?p - place) (spun ?t - tube) (shot ?t - tube) (to-spin ?t - tube) (reached ?p - place))
      (:action put :parameters (?t - tube ?f ?p - place) :precondition (and (reached ?p) (at ?t ?f)) :effect (at ?t ?p))
      (:action spin :parameters (?t - tube) :precondition (at ?t centrifuge) :effect (spun ?t))
      (:action photo :parameters (?t - tube)
        :precondition (and (at ?t camera) (imply (to-spin ?t) (spun ?t))) :effect (shot ?t)))""")
    kb = KnowledgeBase(domain.schema)
    known = (fact("at", "blood", "rack"), fact("to-spin", "blood"), fact("reached", "camera"))
    kb.apply(Delta(nodes={"blood": "tube"}, added=known), "test")
    (why,) = why_unsolvable(domain, kb, parse_condition("(shot blood)"))
    assert "(shot blood) needs (photo blood), which needs (imply (to-spin blood) (spun blood))" in why
    assert why.endswith("(reached centrifuge) does not hold, and no planning action makes it true")
