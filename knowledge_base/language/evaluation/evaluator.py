"""Evaluation of conditions, terms and effects on a world: truth, answers, values and changes.

Conditions are compiled at their first use and cached by identity. Each later evaluation of the same expression costs
only its look-ups. No text is executed.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

from knowledge_base.errors import SchemaError
from knowledge_base.facts import VALUE_TYPES, Content, Delta, Fact, Value, require_content
from knowledge_base.language.checking.binding import check_answers, check_bound
from knowledge_base.language.checking.check import check_arity
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.evaluation.compiler import Answers, compile_answers, compile_query, compile_test
from knowledge_base.language.evaluation.terms import Bindings, Getter, Test, as_number, compile_term
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import (
    Add,
    AllOf,
    Delete,
    Effect,
    ForEach,
    NumericEffect,
    When,
    check_depth,
    effect_leaves,
    mentioned,
)
from knowledge_base.language.syntax.expression import (
    Arithmetic,
    Atom,
    Call,
    Constant,
    Expression,
    Term,
    TypedVariable,
    Variable,
    free_variables,
    variables_in_order,
)
from knowledge_base.language.syntax.identity_cache import IdentityCache

NO_BINDINGS: Bindings = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Asked:
    """A compiled condition with its free variables."""

    e: Expression
    free: frozenset[str]
    test: Test

    def holds(self, world: World, bindings: Mapping[str, Value]) -> bool:
        """Return whether the condition is true in `world`; errors as for the function `holds`."""
        for name in self.free:
            if type(bindings.get(name)) not in VALUE_TYPES:
                check_bound(self.e, bindings)
        return self.test(world, bindings)


@dataclass(frozen=True)  # without slots, for the cached property
class Queried:
    """A query, compiled for a set of bound variables.

    Attributes:
        e: the query; the reference keeps it alive as long as its compiled form.
        answers: returns the values of the other variables, as `query` does.
        schema: the declarations.
        bound: the bound variables.
    """

    e: Expression
    answers: Answers
    schema: Vocabulary
    bound: frozenset[str]

    @cached_property
    def rows(self) -> Callable[[World, Bindings], Iterator[dict[str, Value]]]:
        """Function that yields the answers one by one, as `rows` does."""
        names = asked_for(self.e, self.bound)
        search = compile_query(self.schema.expanded(self.e), self.schema, self.bound)
        return lambda world, bindings: ({name: each[name] for name in names} for each in search(world, bindings))


_terms: IdentityCache[Term, tuple[frozenset[str], Getter]] = IdentityCache()
"""The free variables of a term, and the function that returns its value."""
_conditions: IdentityCache[Expression, Asked] = IdentityCache()
_queries: IdentityCache[Expression, tuple[frozenset[str], dict[frozenset[str], Queried]]] = IdentityCache()
"""The free variables of a query, and its compiled searches by their bound variables."""


def holds(e: Expression, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> bool:
    """Return whether `e` is true in `world`; variables in `bindings` that `e` does not contain are ignored.

    Raises:
        UnknownNameError: a free variable is not bound, or a predicate, function or type is not declared.
        SchemaError: a wrong number of arguments, or an operator such as `<` compares a value that is not a number.
        InputError: the nesting is too deep, or a part cannot be computed.
    """
    return asked(e, world.schema).holds(world, bindings)


def asked(e: Expression, schema: Vocabulary) -> Asked:
    """Return the condition compiled for worlds with this schema; errors of the text as for `holds`."""
    found = _conditions.find(e, schema)
    if found is None:
        check_depth(e)
        found = _conditions.keep(e, schema, Asked(e, free_variables(e), compile_test(schema.expanded(e), schema)))
    return found


def query(e: Expression, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> list[dict[str, Value]]:
    """Return the bindings of the free variables of `e` that make it true in `world`, each binding once.

    Without unbound variables, the result is `[{}]` when `e` is true and `[]` when it is false. The order of answers and
    of their variables depends only on the text and on the world with its order of insertion.

    Raises:
        InputError: an unbound variable occurs only under `not` or in a comparison.
        UnknownNameError, SchemaError: as for `holds`.
    """
    return queried(e, world.schema, bindings).answers(world, bindings)


def rows(e: Expression, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> Iterator[dict[str, Value]]:
    """Yield the answers of `query` in the same order; `world` must not change before the last answer.

    An error about candidates without a computable value is raised after all answers; other errors as for `query`.
    """
    return queried(e, world.schema, bindings).rows(world, bindings)


def queried(e: Expression, schema: Vocabulary, params: Iterable[str]) -> Queried:
    """Return the query compiled for the bound variables `params`; errors of the text as for `query`."""
    queries = _queries.find(e, schema)
    if queries is None:
        check_depth(e)
        queries = _queries.keep(e, schema, (free_variables(e), {}))
    free, by_bound = queries
    bound = free.intersection(params)
    found = by_bound.get(bound)
    if found is None:
        expanded = schema.expanded(e)
        check_answers(expanded, bound, schema)
        found = by_bound[bound] = Queried(
            e, compile_answers(expanded, schema, bound, asked_for(e, bound)), schema, bound
        )
    return found


def evaluate_term(term: Term, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> Content:
    """Return the value of `term` in `world`.

    Raises:
        UnknownNameError: a free variable is not bound, or a function is not declared.
        SchemaError: an operand of arithmetic is not a number.
        InputError: a division by zero, or a result that is too large.
    """
    if isinstance(term, Constant):
        return term.value
    if isinstance(term, Variable) and term.name in bindings:
        return bindings[term.name]
    schema = world.schema
    known = _terms.find(term, schema)
    if known is None:
        check_depth(term)
        known = _terms.keep(term, schema, (free_variables(term), compile_term(term, schema)))
    free, get = known
    for name in free:
        if type(bindings.get(name)) not in VALUE_TYPES:
            check_bound(term, bindings)
    return get(world, bindings)


def evaluate_argument(term: Term, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> Value:
    """Return the value of `term` as an argument of a fact.

    Errors as for `evaluate_term`; a geometry is a `SchemaError`.
    """
    found = evaluate_term(term, world, bindings)
    if isinstance(found, tuple):
        raise SchemaError("a geometry can be compared, but is not an argument of a fact", place=term.place)
    return found


def asked_for(e: Expression, bound: frozenset[str]) -> tuple[str, ...]:
    """Return the free variables of `e` that are not in `bound`, without repetitions, in the order of the text."""
    return tuple(dict.fromkeys(name for name in variables_in_order(e) if name not in bound))


_ARITHMETIC = {"increase": "+", "decrease": "-", "scale-up": "*", "scale-down": "/"}


def apply_effect(effect: Effect, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> Delta:
    """Return the changes of `effect` in `world`, which stays unchanged.

    All conditions and values refer to the world before the effect (PDDL 2.1). A fact that is both deleted and added
    becomes true. Several increases and decreases of one number in an effect add up; two different assignments
    contradict each other.

    Raises:
        UnknownNameError: a variable is not bound, or a name is not declared.
        SchemaError: contradicting assignments, a wrong number of arguments, or an operand that is not a number.
        InputError: the nesting is too deep.
    """
    check_depth(effect)
    application = _Application(world)
    application.apply(effect, bindings)
    added = tuple(application.added)
    removed = tuple(f for f in application.removed if f not in application.added)
    return Delta(removed=removed, added=added, values=application.values)


def choices(variables: tuple[TypedVariable, ...], world: World) -> Iterator[dict[str, Value]]:
    """Yield every choice of objects for `variables`, in order of insertion."""
    things = [
        tuple(dict.fromkeys(thing for t in v.types or ("object",) for thing in world.objects(t))) for v in variables
    ]
    for chosen in itertools.product(*things):
        yield {v.name: thing for v, thing in zip(variables, chosen, strict=True)}


class _Application:
    """Collector of the changes of an effect; dictionaries represent ordered sets."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.added: dict[Fact, None] = {}
        self.removed: dict[Fact, None] = {}
        self.values: dict[Fact, Content] = {}
        self.computed: set[Fact] = set()

    def apply(self, effect: Effect, bindings: Bindings) -> None:
        self.world.spend()
        match effect:
            case Add(atom):
                self.added[self.fact(atom, bindings)] = None
            case Delete(atom):
                self.removed[self.fact(atom, bindings)] = None
            case AllOf(parts):
                for part in parts:
                    self.apply(part, bindings)
            case ForEach(_, inner):
                for choice in self.different(effect):
                    self.apply(inner, {**bindings, **choice})
            case When(condition, inner):
                if holds(condition, self.world, bindings):
                    self.apply(inner, bindings)
            case NumericEffect():
                self.assign(effect, bindings)

    def different(self, effect: ForEach) -> Iterator[dict[str, Value]]:
        """Yield one choice of objects for each different instance of the inner effect.

        A variable that the inner effect does not mention needs an object, but makes no further instance. Only numeric
        effects of equal instances add up.
        """
        used, unused = _by_use(effect)
        if all(next(choices((variable,), self.world), None) for variable in unused):
            yield from choices(used, self.world)

    def fact(self, atom: Atom, bindings: Bindings) -> Fact:
        signature = self.world.schema.told(atom.predicate, atom.place)
        check_arity(signature, len(atom.args), atom.place)
        return self.instance(atom.predicate, atom, bindings)

    def instance(self, name: str, form: Atom | Call, bindings: Bindings) -> Fact:
        return Fact(name, tuple(evaluate_argument(a, self.world, bindings) for a in form.args))

    def assign(self, effect: NumericEffect, bindings: Bindings) -> None:
        call, operator = effect.call, effect.operator
        fluent = self.instance(call.function, call, bindings)
        old = self.values.get(fluent, evaluate_term(call, self.world, bindings))
        change = evaluate_term(effect.value, self.world, bindings)
        again = fluent in self.values
        if operator == "assign":
            require_content(change, self.world.schema.result(call.function), fluent, effect.place)
            self.refuse(again and (fluent in self.computed or old != change), fluent, effect)
            self.values[fluent] = change
            return
        self.refuse(again and fluent not in self.computed, fluent, effect)
        self.computed.add(fluent)
        sides = tuple(Constant(as_number(side, operator, effect.place)) for side in (old, change))
        self.values[fluent] = evaluate_term(Arithmetic(_ARITHMETIC[operator], sides, place=effect.place), self.world)

    def refuse(self, contradicts: bool, fluent: Fact, effect: NumericEffect) -> None:  # noqa: FBT001
        if contradicts:
            raise SchemaError(f"the effect changes {fluent} in two ways that contradict", place=effect.place)


_Variables = tuple[TypedVariable, ...]
_uses: IdentityCache[Effect, tuple[_Variables, _Variables]] = IdentityCache()


def _by_use(effect: ForEach) -> tuple[_Variables, _Variables]:
    """Return the variables on which the instances of the inner effect depend, and the other variables."""
    known = _uses.find(effect, None)
    if known is not None:
        return known
    adds_up = any(isinstance(leaf, NumericEffect) for leaf in effect_leaves(effect.effect))
    inner = mentioned(effect.effect)
    used = tuple(one for one in effect.variables if adds_up or one.name in inner)
    return _uses.keep(effect, None, (used, tuple(one for one in effect.variables if one not in used)))
