"""Small worlds and random expressions about them, and a slow evaluator that needs no cleverness."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from hypothesis import strategies as st

from knowledge_base.facts import Delta, Fact
from knowledge_base.language.syntax import effect as eff
from knowledge_base.language.syntax import expression as ex
from knowledge_base.world.schema import Schema

SCHEMA = Schema.parse(
    """(define (domain small)
      (:types item place - object cup can - item)
      (:constants home - place)
      (:predicates (quiet) (heavy ?i - item) (on ?i - item ?p - place) (near ?a ?b - place)
                   (between ?i ?j - item ?p - place) (level ?i - item ?n - number))
      (:functions (weight ?i - item) (distance ?a ?b - place) (time) (gap ?i ?j - item ?p - place) - number
                  (label ?i - item) - text (closed ?p - place) - boolean (pose ?i - item ?p - place) - geometry))""",
    "small.pddl",
)
THINGS = {"cup1": "cup", "cup2": "cup", "can1": "can", "shelf": "place", "home": "place"}
NAMES = ("x", "y", "z", "event.item")

# --- any expression, for text


def _text_names() -> st.SearchStrategy[str]:
    return st.from_regex(r"[a-z][a-z0-9_.-]{0,6}", fullmatch=True).filter(
        lambda s: s not in (*ex.KEYWORDS, *ex.COMPUTING, *eff.EFFECT_KEYWORDS, "true", "false")
    )


def _values() -> st.SearchStrategy[ex.Constant]:
    numbers = st.integers(-(10**9), 10**9) | st.floats(allow_nan=False, allow_infinity=False)
    plain = st.builds(ex.Constant, numbers | st.booleans() | _text_names())
    return plain | st.builds(ex.Constant, st.text(max_size=8), quoted=st.just(True))


def any_terms() -> st.SearchStrategy[ex.Term]:
    variables = st.builds(ex.Variable, _text_names())

    def compound(inner: st.SearchStrategy[ex.Term]) -> st.SearchStrategy[ex.Term]:
        some = st.lists(inner, max_size=3).map(tuple)
        pair = st.tuples(inner, inner)
        return (
            st.builds(ex.Call, _text_names(), some)
            | st.builds(ex.Arithmetic, st.sampled_from("+-*/"), pair)
            | st.builds(ex.Arithmetic, st.just("-"), st.tuples(inner))
            | st.builds(ex.Arithmetic, st.just("geometry"), some)
        )

    return st.recursive(variables | _values(), compound, max_leaves=4)


def any_variables() -> st.SearchStrategy[tuple[ex.TypedVariable, ...]]:
    types = st.lists(_text_names(), max_size=2, unique=True).map(tuple)
    variable = st.builds(ex.TypedVariable, _text_names(), types)
    return st.lists(variable, max_size=3, unique_by=lambda v: v.name).map(tuple)


def any_atoms() -> st.SearchStrategy[ex.Atom]:
    return st.builds(ex.Atom, _text_names(), st.lists(any_terms(), max_size=3).map(tuple))


def any_expressions() -> st.SearchStrategy[ex.Expression]:
    comparisons = st.builds(ex.Comparison, st.sampled_from(ex.COMPARISONS), any_terms(), any_terms())
    return _compound(any_atoms() | comparisons, any_variables())


def any_effects() -> st.SearchStrategy[eff.Effect]:
    call = st.builds(ex.Call, _text_names(), st.lists(any_terms(), max_size=2).map(tuple))
    leaf = (
        st.builds(eff.Add, any_atoms())
        | st.builds(eff.Delete, any_atoms())
        | st.builds(eff.NumericEffect, st.sampled_from(eff.ASSIGNMENTS), call, any_terms())
    )
    return st.recursive(
        leaf,
        lambda inner: (
            st.builds(eff.AllOf, st.lists(inner, max_size=3).map(tuple))
            | st.builds(eff.ForEach, any_variables(), inner)
            | st.builds(eff.When, any_expressions(), inner)
        ),
        max_leaves=5,
    )


def _compound(
    leaf: st.SearchStrategy[ex.Expression], variables: st.SearchStrategy[tuple[ex.TypedVariable, ...]]
) -> st.SearchStrategy[ex.Expression]:
    def compound(inner: st.SearchStrategy[ex.Expression]) -> st.SearchStrategy[ex.Expression]:
        some = st.lists(inner, max_size=3).map(tuple)
        return (
            st.builds(ex.Not, inner)
            | st.builds(ex.And, some)
            | st.builds(ex.Or, some)
            | st.builds(ex.Imply, inner, inner)
            | st.builds(ex.Exists, variables, inner)
            | st.builds(ex.Forall, variables, inner)
        )

    return st.recursive(leaf, compound, max_leaves=6)


# --- expressions that mean something on worlds of SCHEMA


def expressions() -> st.SearchStrategy[ex.Expression]:
    term = st.sampled_from([ex.Variable(n) for n in NAMES[:3]] + [ex.Constant(t) for t in THINGS])
    typed = st.builds(ex.TypedVariable, st.sampled_from(NAMES[:3]), st.sampled_from([(), ("item",), ("cup", "place")]))
    arities = {"quiet": 0, "heavy": 1, "on": 2, "near": 2, "between": 3, "cup": 1, "item": 1, "object": 1}
    atoms = st.sampled_from(sorted(arities)).flatmap(
        lambda p: st.builds(ex.Atom, st.just(p), st.tuples(*[term] * arities[p]))
    )
    weight = st.builds(ex.Call, st.just("weight"), st.tuples(term))
    number = weight | st.builds(ex.Constant, st.integers(0, 2))
    sums = st.builds(ex.Arithmetic, st.sampled_from("+-*"), st.tuples(number, number))
    equal = st.builds(ex.Comparison, st.sampled_from(["=", "!="]), term, term)
    ordered = st.builds(ex.Comparison, st.sampled_from(ex.COMPARISONS), number | sums, number)
    quantified = st.lists(typed, max_size=2, unique_by=lambda v: v.name).map(tuple)
    return _compound(atoms | equal | ordered, quantified)


def deltas() -> st.SearchStrategy[Delta]:
    """Changes of worlds that have `THINGS`."""
    items, places = st.sampled_from(["cup1", "cup2", "can1"]), st.sampled_from(["shelf", "home"])
    number = st.integers(0, 2)
    facts = st.one_of(
        st.just(Fact("quiet")),
        st.builds(lambda *a: Fact("heavy", a), items),
        st.builds(lambda *a: Fact("on", a), items, places),
        st.builds(lambda *a: Fact("near", a), places, places),
        st.builds(lambda *a: Fact("between", a), items, items, places),
        st.builds(lambda *a: Fact("level", a), items, number),
    )
    numeric = st.one_of(
        st.just(Fact("time")),
        st.builds(lambda *a: Fact("weight", a), items),
        st.builds(lambda *a: Fact("distance", a), places, places),
        st.builds(lambda *a: Fact("gap", a), items, items, places),
    )
    poses = st.builds(lambda *a: Fact("pose", a), items, places)
    values = st.one_of(
        st.tuples(numeric, number),
        st.tuples(st.builds(lambda *a: Fact("label", a), items), st.text(max_size=3)),
        st.tuples(st.builds(lambda *a: Fact("closed", a), places), st.booleans()),
        st.tuples(poses, st.lists(number | st.floats(-9, 9), max_size=4).map(tuple)),
    )
    some = st.lists(facts, max_size=6).map(tuple)
    return st.builds(
        Delta, nodes=st.just(THINGS), removed=some, added=some, values=st.lists(values, max_size=3).map(dict),
        replaced=st.dictionaries(items, places, max_size=2).map(lambda at: tuple(Fact("on", pair) for pair in at.items())),
    ).map(consistent)  # fmt: skip


def consistent(delta: Delta) -> Delta:
    """The change without the removals that contradict it."""
    true = {*delta.added, *delta.replaced}
    return replace(delta, removed=tuple(one for one in delta.removed if one not in true))


def removals() -> st.SearchStrategy[Delta]:
    """Changes that take `THINGS` away."""
    some_things = st.lists(st.sampled_from(["cup1", "cup2", "shelf"]), max_size=2).map(tuple)
    return st.builds(Delta, removed_nodes=some_things)


# --- the slow evaluator


def _same(left, right) -> bool:
    return left == right and isinstance(left, bool) == isinstance(right, bool)


_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "=": _same, "!=": lambda left, right: not _same(left, right),
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_COMPUTE = {"+": operator.add, "-": operator.sub, "*": operator.mul}


def brute_term(term, world, b):
    match term:
        case ex.Variable(name):
            return b[name]
        case ex.Constant(value):
            return value
        case ex.Call(function, args):
            return world.value(function, tuple(brute_term(a, world, b) for a in args))
        case ex.Arithmetic(op, (left, right)):
            return _COMPUTE[op](brute_term(left, world, b), brute_term(right, world, b))


def brute(e, world, b) -> bool:  # noqa: PLR0911  one line a form, as in the textbook
    """The textbook definition of truth."""
    match e:
        case ex.Atom(name, args):
            values = tuple(brute_term(a, world, b) for a in args)
            return values[0] in world.objects(name) if name in world.schema.types else world.holds(name, values)
        case ex.Comparison(op, left, right):
            return _COMPARE[op](brute_term(left, world, b), brute_term(right, world, b))
        case ex.Not(body):
            return not brute(body, world, b)
        case ex.And(parts):
            return all(brute(p, world, b) for p in parts)
        case ex.Or(parts):
            return any(brute(p, world, b) for p in parts)
        case ex.Imply(premise, conclusion):
            return not brute(premise, world, b) or brute(conclusion, world, b)
        case ex.Exists(variables, body):
            return any(brute(body, world, {**b, **c}) for c in brute_choices(variables, world))
        case ex.Forall(variables, body):
            return all(brute(body, world, {**b, **c}) for c in brute_choices(variables, world))
    raise AssertionError(e)


def brute_choices(variables, world):
    things = [{o for t in v.types or ("object",) for o in world.objects(t)} for v in variables]
    for chosen in itertools.product(*things):
        yield dict(zip([v.name for v in variables], chosen, strict=True))
