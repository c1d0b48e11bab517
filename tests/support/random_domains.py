"""Small random domains with numbers, costs, disjunctions and conditional effects; few states each."""

from __future__ import annotations

from hypothesis import strategies as st

from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase
from planning.model.domain import PlanningDomain

THINGS = "ab"
FACTS = [fact("p", one) for one in THINGS] + [fact("r")]
FLUENTS = [fact("f", one) for one in THINGS] + [fact("g")]

_number = st.sampled_from(["(f ?x)", "(f a)", "(g)", "1", "2", "(+ (f ?x) (g))", "(* 2 (g))", "(limit)"])
_comparison = st.builds("({} {} {})".format, st.sampled_from(["<", ">=", "=", ">"]), _number, _number)
_literal = st.sampled_from(["(p ?x)", "(p a)", "(r)", "(not (p ?x))", "(not (r))"])
_leaf = st.one_of(_literal, _comparison)
_condition = st.one_of(
    st.just("(and)"), _leaf, st.builds("({} {} {})".format, st.sampled_from(["and", "or", "imply"]), _leaf, _leaf)
)
# What moves a number keeps it between 0 and 3, so that there are few states.
_move = st.sampled_from(
    [
        ("(< (f ?x) 3)", "(increase (f ?x) 1)"),
        ("(> (f ?x) 0)", "(decrease (f ?x) 1)"),
        ("(< (g) 3)", "(increase (g) 1)"),
        ("(and)", "(assign (g) (f ?x))"),
        ("(and)", "(assign (f ?x) (g))"),
        ("(< (f ?x) 2)", "(assign (f ?x) (* 2 (f ?x)))"),
    ]
)
_change = st.one_of(_literal, st.builds("(when {} {})".format, _leaf, _literal))
_action = st.tuples(_condition, st.lists(_move, max_size=1), st.lists(_change, max_size=2), st.integers(0, 2))
ACTIONS = st.lists(_action, min_size=2, max_size=4)
START = st.tuples(st.sets(st.sampled_from(FACTS), max_size=1), st.tuples(*3 * [st.integers(0, 1)]), st.integers(0, 2))
_wanted = st.sampled_from(["(p a)", "(p b)", "(r)", "(> (f b) 1)", "(= (f a) 3)", "(>= (g) 2)", "(< (f a) (g))"])
GOAL = st.one_of(
    st.builds("(and {} {})".format, _wanted, _wanted),
    st.builds("(or (and {0} {1}) (and {2} (not {1})))".format, *3 * [_wanted]),
)


def domain_of(actions):
    return PlanningDomain.parse(domain_text(actions))


def domain_text(actions):
    def action(number, condition, moves, changes, cost):
        asked, moved = (" ".join(part) for part in zip(*moves, strict=True)) if moves else ("", "")
        effects = " ".join([moved, *changes, f"(increase (total-cost) {cost})"])
        return (
            f"(:action a{number} :parameters (?x - thing) :precondition (and {condition} {asked})"
            f" :effect (and {effects}))"
        )

    return (
        "(define (domain d) (:types thing) (:constants a b - thing) (:predicates (p ?t - thing) (r))"
        " (:functions (f ?t - thing) (g) (limit) (total-cost))"
        + " ".join(action(number, *parts) for number, parts in enumerate(actions))
        + ")"
    )


def world_of(domain, state, limit):
    facts, numbers = state
    world = KnowledgeBase(domain.schema)
    values = {**dict(zip(FLUENTS, numbers, strict=True)), fact("limit"): limit}
    world.apply(Delta(added=tuple(sorted(facts, key=str)), values=values), author="test")
    return world


def state_of(world):
    facts = frozenset(one for one in FACTS if world.holds(one.predicate, one.args))
    return facts, tuple(world.value(one.predicate, one.args) for one in FLUENTS)
