"""Terms compiled to closures: the value of an argument or of a side of a comparison in a world."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from operator import itemgetter
from typing import cast

from knowledge_base.errors import InputError, Place, SchemaError
from knowledge_base.facts import GEOMETRY, Content, Value
from knowledge_base.language.checking.check import check_arity
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import Arithmetic, Call, Comparison, Constant, Term, Variable

Bindings = Mapping[str, Value]
Getter = Callable[[World, Bindings], Content]
Argument = Callable[[World, Bindings], Value]
Test = Callable[[World, Bindings], bool]
Number = int | float

ORDER: Mapping[str, Callable[[Number, Number], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
"""The comparisons of numbers; `same` compares all values."""
FOLD: Mapping[str, Callable[[Number, Number], Number]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
"""The operators of arithmetic, for two numbers."""


def compile_term(term: Term, schema: Vocabulary) -> Getter:
    """Return a function that returns the value of the term; a caller must bind all its variables.

    Raises:
        UnknownNameError: an undeclared function.
        SchemaError: a wrong number of arguments.
    """
    match term:
        case Variable(name):
            return lambda _world, bindings: bindings[name]
        case Constant(value):
            return lambda _world, _bindings: value
        case Call():
            return _call(term, schema)
        case Arithmetic():
            return _arithmetic(term, schema)


def compile_arguments(terms: tuple[Term, ...], schema: Vocabulary) -> Callable[[World, Bindings], tuple[Value, ...]]:
    """Return a function that returns the values of all terms."""
    constants = tuple(t.value for t in terms if isinstance(t, Constant))
    if len(constants) == len(terms):
        return lambda _world, _bindings: constants
    names = [t.name for t in terms if isinstance(t, Variable)]
    if len(names) == len(terms):
        if len(names) == 1:
            only = names[0]
            return lambda _world, bindings: (bindings[only],)
        pick = itemgetter(*names)
        return lambda _world, bindings: pick(bindings)
    getters = tuple(compile_argument(t, schema) for t in terms)
    return lambda world, bindings: tuple([get(world, bindings) for get in getters])


def compile_argument(term: Term, schema: Vocabulary) -> Argument:
    """Return a function that returns the value of an argument of a fact; errors as for `compile_term`.

    Raises:
        SchemaError: the value would be a geometry.
    """
    geometry = isinstance(term, Arithmetic) and term.operator == GEOMETRY
    if geometry or (isinstance(term, Call) and schema.result(term.function, term.place) == GEOMETRY):
        raise SchemaError("a geometry can be compared, but is not an argument of a fact", place=term.place)
    return cast("Argument", compile_term(term, schema))


def compile_comparison(e: Comparison, schema: Vocabulary) -> Test:
    """Return a function that compares the two sides: `=` and `!=` compare any values, the others only numbers.

    The returned function raises `SchemaError` if one of the other operators compares a value that is not a number.
    """
    if e.operator == "=" and isinstance(e.left, Variable) and isinstance(e.right, Variable | Constant):
        return compile_membership(e.left.name, [e.right])
    left, right = compile_term(e.left, schema), compile_term(e.right, schema)
    if e.operator == "=":
        return lambda world, b: same(left(world, b), right(world, b))
    if e.operator == "!=":
        return lambda world, b: not same(left(world, b), right(world, b))
    ordered, name = ORDER[e.operator], e.operator
    places = (e.left.place or e.place, e.right.place or e.place)
    if isinstance(e.right, Constant):
        bound = as_number(e.right.value, name, places[1])
        return lambda world, b: ordered(as_number(left(world, b), name, places[0]), bound)

    def test(world: World, b: Bindings) -> bool:
        first = as_number(left(world, b), name, places[0])
        return ordered(first, as_number(right(world, b), name, places[1]))

    return test


def compile_membership(name: str, terms: Sequence[Variable | Constant]) -> Test:
    """Return a function that tests whether the value of a variable equals the value of one of the terms."""
    names = tuple([term.name for term in terms if isinstance(term, Variable)])
    values = tuple([term.value for term in terms if isinstance(term, Constant)])

    def test(_: World, bindings: Bindings) -> bool:
        value = bindings[name]
        for other in names:  # a generator costs twice the time here
            if same(value, bindings[other]):
                return True
        return bool(values) and any(same(value, given) for given in values)

    return test


def same(left: Content, right: Content) -> bool:
    """Return whether the values are equal; a truth value never equals a number, although `True == 1` in Python."""
    return left == right and isinstance(left, bool) == isinstance(right, bool)


def as_number(value: Content, used_by: str, place: Place | None) -> Number:
    """Return `value`, which must be a number.

    Raises:
        SchemaError: `value` is not a number.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SchemaError(f"'{used_by}' works on numbers, not on '{value}'", place=place)
    return value


def _call(call: Call, schema: Vocabulary) -> Getter:
    check_arity(schema.function(call.function, call.place), len(call.args), call.place)
    function, arguments = call.function, compile_arguments(call.args, schema)
    return lambda world, bindings: world.value(function, arguments(world, bindings))


def _arithmetic(term: Arithmetic, schema: Vocabulary) -> Getter:
    name, place = term.operator, term.place
    if name == GEOMETRY:
        numbers = compile_arguments(term.args, schema)
        return lambda world, bindings: tuple([as_number(v, name, place) for v in numbers(world, bindings)])
    combine, arguments = FOLD[name], compile_arguments(term.args, schema)

    def compute(world: World, bindings: Bindings) -> Number:
        first, *rest = (as_number(v, name, place) for v in arguments(world, bindings))
        try:
            if not rest:
                return -first
            for number in rest:
                first = combine(first, number)
            if isfinite(first):
                return first
        except ArithmeticError as error:
            raise InputError(f"'{name}' cannot be computed: {error}", place=place) from None
        raise InputError(f"'{name}' cannot be computed: the result is too large", place=place)

    return compute
