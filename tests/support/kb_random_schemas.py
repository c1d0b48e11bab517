"""Random schemas, and changes of and conditions about worlds that have them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hypothesis import strategies as st
from kb_strategies import brute, consistent

from knowledge_base import Delta, Fact, Schema
from knowledge_base.language.checking.binding import only_tested
from knowledge_base.language.syntax import expression as ex

THINGS, OBJECTS, NUMBER = ("a", "b", "c", "d"), ("x", "y", "z"), "n"
NUMBERS = (0, 1, 2)


@dataclass(frozen=True)
class Language:
    """A schema with its names, and the things of its worlds; the last argument of some predicates is a number."""

    schema: Schema
    types: tuple[str, ...]
    predicates: dict[str, tuple[str, ...]]
    functions: dict[str, int]
    things: dict[str, str]


@st.composite
def languages(draw) -> Language:
    parents = [draw(st.sampled_from(["object", *(f"t{j}" for j in range(i))])) for i in range(draw(st.integers(1, 3)))]
    types = tuple(f"t{i}" for i in range(len(parents)))
    shapes = st.tuples(st.integers(0, 3), st.booleans())
    predicates = {
        f"p{i}": ("object",) * arity + ("number",) * numeric
        for i, (arity, numeric) in enumerate(draw(st.lists(shapes, min_size=1, max_size=3)))
    }
    functions = {f"f{i}": arity for i, arity in enumerate(draw(st.lists(st.integers(0, 2), min_size=1, max_size=2)))}
    declared = " ".join(
        f"({p} {' '.join(f'?a{i} - {kind}' for i, kind in enumerate(kinds))})" for p, kinds in predicates.items()
    )
    computed = " ".join(f"({f} {' '.join(f'?a{i}' for i in range(arity))})" for f, arity in functions.items())
    typed = " ".join(f"{t} - {parent}" for t, parent in zip(types, parents, strict=True))
    text = f"(define (domain d) (:types {typed}) (:predicates {declared}) (:functions {computed}))"
    things = {name: draw(st.sampled_from([*types, "object"])) for name in THINGS}
    return Language(Schema.parse(text), types, predicates, functions, things)


def changes(of: Language) -> st.SearchStrategy[Delta]:
    """Facts, numbers and things that come and go; names not there any more are an error when applied."""
    thing, number = st.sampled_from(THINGS), st.sampled_from(NUMBERS)
    facts = st.one_of(
        [
            st.builds(lambda *a, p=p: Fact(p, a), *(number if kind == "number" else thing for kind in kinds))
            for p, kinds in of.predicates.items()
        ]
    )
    fluents = st.one_of([st.builds(lambda *a, f=f: Fact(f, a), *[thing] * n) for f, n in of.functions.items()])
    some = st.lists(facts, max_size=4).map(tuple)
    return st.builds(
        Delta,
        nodes=st.sets(thing).map(lambda names: {n: of.things[n] for n in sorted(names)}),
        removed=some,
        added=some,
        values=st.dictionaries(fluents, number, max_size=2),
        removed_nodes=st.just(()) | st.lists(thing, max_size=1).map(tuple),
    ).map(consistent)


def conditions(of: Language) -> st.SearchStrategy[ex.Expression]:
    variable = st.sampled_from(OBJECTS)
    thing = st.builds(ex.Variable, variable) | st.builds(ex.Constant, st.sampled_from(THINGS))
    numeral = st.builds(ex.Constant, st.sampled_from(NUMBERS))
    calls = st.one_of([st.builds(lambda *a, f=f: ex.Call(f, a), *[thing] * arity) for f, arity in of.functions.items()])
    number = st.one_of(st.just(ex.Variable(NUMBER)), numeral, calls)
    total = number | st.builds(ex.Arithmetic, st.sampled_from("+-*"), st.tuples(number, number))
    atoms = st.one_of(
        [
            *(
                st.builds(lambda *a, p=p: ex.Atom(p, a), *(total if kind == "number" else thing for kind in kinds))
                for p, kinds in of.predicates.items()
            ),
            *(st.builds(lambda a, t=t: ex.Atom(t, (a,)), thing) for t in of.types),
        ]
    )
    equal = st.builds(ex.Comparison, st.sampled_from(["=", "!="]), thing, thing)
    ordered = st.builds(ex.Comparison, st.sampled_from(ex.COMPARISONS), total, total)
    typed = st.builds(ex.TypedVariable, variable, st.lists(st.sampled_from(of.types), max_size=2).map(tuple))
    quantified = st.lists(typed, min_size=1, max_size=2, unique_by=lambda v: v.name).map(tuple)

    def compound(inner):
        some = st.lists(inner, min_size=1, max_size=3).map(tuple)
        return st.one_of(
            st.builds(ex.Not, inner),
            st.builds(ex.And, some),
            st.builds(ex.And, some),
            st.builds(ex.Or, some),
            st.builds(ex.Imply, inner, inner),
            st.builds(ex.Exists, quantified, inner),
            st.builds(ex.Forall, quantified, inner),
        )

    return st.recursive(atoms | equal | ordered, compound, max_leaves=5)


@st.composite
def parameters(draw, e: ex.Expression, schema: Schema) -> dict[str, Any]:
    """Values for the variables that need one, and for some others."""
    free = ex.free_variables(e)
    chosen = [name for name in sorted(free) if name in only_tested(e, schema) or draw(st.integers(0, 2)) == 0]
    return {name: draw(st.sampled_from(NUMBERS if name == NUMBER else THINGS)) for name in chosen}


def brute_witnesses(e: ex.Expression, params: dict[str, Any], world) -> list[dict[str, Any]]:
    """All choices for the free variables that make it true, in an order that does not depend on the world's history."""
    found: list[dict[str, Any]] = [{}]
    for name in sorted(ex.free_variables(e) - params.keys()):
        values = NUMBERS if name == NUMBER else sorted(world.objects("object"))
        found = [{**one, name: value} for one in found for value in values]
    return [one for one in found if brute(e, world, {**params, **one})]
