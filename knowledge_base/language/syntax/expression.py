"""Conditions and terms as immutable values, without a world.

The language has the conditions of PDDL 2.1 (Fox & Long 2003), `!=`, quoted text and truth values; a type is also a
unary predicate. Equality ignores places, so that the same text at two places results in equal expressions.
"""

from __future__ import annotations

import itertools
from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace
from typing import overload

from knowledge_base.errors import Place
from knowledge_base.facts import GEOMETRY, Value
from knowledge_base.spelling import is_plain_name


@dataclass(frozen=True, slots=True)
class Located:
    """Base of all values read from text; `place` is only for messages."""

    place: Place | None = field(default=None, compare=False, repr=False, kw_only=True)


@dataclass(frozen=True, slots=True)
class TypedVariable(Located):
    """A parameter or quantified variable.

    No types, or only `object`, means any type; several types mean `either`. A type that begins with `?` is the name of
    a variable, whose value is a list of a plot: the quantified variable goes through its elements.
    """

    name: str
    types: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.types == ("object",):
            object.__setattr__(self, "types", ())


@dataclass(frozen=True, slots=True)
class Variable(Located):
    """A variable such as `?x`, stored by its name without the question mark.

    `?event.item` has the name `event.item`.
    """

    name: str


@dataclass(frozen=True, slots=True)
class Constant(Located):
    """An object's name, a number, a truth value, or text in quotes.

    Text that needs quotes (blanks, upper case) is always `quoted`, so that the text of a value is read as an equal
    value. Quoted text denotes the object with exactly that spelling.
    """

    value: Value
    quoted: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.value, str) and not is_plain_name(self.value):
            object.__setattr__(self, "quoted", True)


@dataclass(frozen=True, slots=True)
class Call(Located):
    """The value of a function: `(failures ?item)`."""

    function: str
    args: tuple[Term, ...] = ()


@dataclass(frozen=True, slots=True)
class Arithmetic(Located):
    """A value computed from numbers by `+ - * /`; `-` with one argument negates.

    The operator `geometry` returns a tuple of the numbers.
    """

    operator: str
    args: tuple[Term, ...]


Term = Variable | Constant | Call | Arithmetic


@dataclass(frozen=True, slots=True)
class Atom(Located):
    """A predicate with its arguments, or a type with one argument: `(on ?o table)`, `(cup ?o)`."""

    predicate: str
    args: tuple[Term, ...] = ()


@dataclass(frozen=True, slots=True)
class Not(Located):
    """A condition that is true when `body` is false."""

    body: Expression


@dataclass(frozen=True, slots=True)
class And(Located):
    """A condition that is true when all parts are true; `(and)` is true."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Or(Located):
    """A condition that is true when some part is true; `(or)` is false."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Imply(Located):
    """A condition that is false only when `premise` is true and `conclusion` is false."""

    premise: Expression
    conclusion: Expression


@dataclass(frozen=True, slots=True)
class Exists(Located):
    """A condition that is true when `body` is true for some choice of known objects."""

    variables: tuple[TypedVariable, ...]
    body: Expression


@dataclass(frozen=True, slots=True)
class Forall(Located):
    """A condition that is true when `body` is true for all choices of known objects."""

    variables: tuple[TypedVariable, ...]
    body: Expression


@dataclass(frozen=True, slots=True)
class Comparison(Located):
    """A comparison with `= != < <= > >=`; the first two compare any values, the others only numbers."""

    operator: str
    left: Term
    right: Term


Expression = Atom | Not | And | Or | Imply | Exists | Forall | Comparison

TRUE = And(())
"""`(and)`, the condition that is always true."""

COMPARISONS = ("=", "!=", "<", "<=", ">", ">=")
ARITHMETIC = ("+", "-", "*", "/")
COMPUTING = (*ARITHMETIC, GEOMETRY)
"""The words at the start of a term that are not functions."""
KEYWORDS = ("and", "or", "not", "imply", "exists", "forall", *COMPARISONS)
"""The words at the start of a condition that are not predicates."""


def variables_in_order(e: Expression | Term) -> list[str]:
    """Return the names of the free variables from left to right, with repetitions."""
    found: list[str] = []
    _add_variables(e, frozenset(), found)
    return found


def _add_variables(e: Expression | Term, bound: frozenset[str], found: list[str]) -> None:
    if isinstance(e, Variable):
        if e.name not in bound:
            found.append(e.name)
    elif isinstance(e, Exists | Forall):
        for variable in e.variables:
            if variable.types and variable.types[0][:1] == "?" and variable.types[0][1:] not in bound:
                found.append(variable.types[0][1:])  # noqa: PERF401  # a comprehension costs a call
        _add_variables(e.body, bound.union([v.name for v in e.variables]), found)
    else:
        for part in parts_of(e):
            _add_variables(part, bound, found)


def parts_of(e: Expression | Term) -> tuple[Expression | Term, ...]:
    """Return the expressions and terms that `e` directly consists of."""
    match e:  # the most frequent forms first
        case Atom() | Call() | Arithmetic():
            return e.args
        case And() | Or():
            return e.parts
        case Not() | Exists() | Forall():
            return (e.body,)
        case Imply(first, second) | Comparison(_, first, second):
            return (first, second)
        case _:
            return ()


def is_equality(e: Expression) -> bool:
    """Return whether the expression is an equality of variables or constants, which has a value in each world."""
    plain = (Variable, Constant)
    return isinstance(e, Comparison) and e.operator == "=" and isinstance(e.left, plain) and isinstance(e.right, plain)


def free_variables(e: Expression | Term) -> frozenset[str]:
    """Return the names of the variables in `e` that no quantifier binds."""
    return frozenset(variables_in_order(e))


def variable_place(e: Expression | Term, name: str) -> Place | None:
    """Return the place of the first `?name` in `e`, or `None`."""
    if isinstance(e, Variable):
        return e.place if e.name == name else None
    found = (variable_place(part, name) for part in parts_of(e))
    return next((place for place in found if place is not None), None)


@overload
def substitute(e: Atom, bindings: Mapping[str, Value | Term]) -> Atom: ...
@overload
def substitute(e: Call, bindings: Mapping[str, Value | Term]) -> Call: ...
@overload
def substitute(e: Expression, bindings: Mapping[str, Value | Term]) -> Expression: ...
@overload
def substitute(e: Term, bindings: Mapping[str, Value | Term]) -> Term: ...
def substitute(e: Expression | Term, bindings: Mapping[str, Value | Term]) -> Expression | Term:
    """Return `e` with its free variables replaced by the values or terms in `bindings`.

    A quantified variable hides an outer variable of the same name. Names in `bindings` that are not free in `e` are
    ignored. Places are kept. If a new term contains the name of a quantified variable, that variable is renamed.
    """
    if not bindings:
        return e
    made: Expression | Term = e
    match e:
        case Variable(name) if name in bindings:
            value = bindings[name]
            made = value if isinstance(value, Term) else Constant(value, place=e.place)
        case Atom(_, args) | Call(_, args) | Arithmetic(_, args):
            made = replace(e, args=tuple(substitute(arg, bindings) for arg in args))
        case And(parts) | Or(parts):
            made = replace(e, parts=tuple(substitute(part, bindings) for part in parts))
        case Not(body):
            made = replace(e, body=substitute(body, bindings))
        case Imply(premise, conclusion):
            made = replace(e, premise=substitute(premise, bindings), conclusion=substitute(conclusion, bindings))
        case Comparison(_, left, right):
            made = replace(e, left=substitute(left, bindings), right=substitute(right, bindings))
        case Exists(variables, body) | Forall(variables, body):
            variables, inner = _enter(variables, body, bindings)
            made = replace(e, variables=variables, body=substitute(body, inner))
        case Variable() | Constant():
            pass
    return made


def _enter(
    variables: tuple[TypedVariable, ...], body: Expression, bindings: Mapping[str, Value | Term]
) -> tuple[tuple[TypedVariable, ...], dict[str, Value | Term]]:
    """Return the variables of a quantifier and the bindings for its body.

    If a new term contains the name of a quantified variable, that variable is renamed.
    """
    own, free = {v.name for v in variables}, free_variables(body)
    variables = tuple(replace(v, types=tuple(_new_list(name, bindings) for name in v.types)) for v in variables)
    inner = {name: value for name, value in bindings.items() if name in free and name not in own}
    met = {name for value in inner.values() if isinstance(value, Term) for name in variables_in_order(value)}
    if own.isdisjoint(met):
        return variables, inner
    names = {name: fresh(name, own | free | met) for name in own & met}
    inner |= {name: Variable(new) for name, new in names.items()}
    return tuple(replace(v, name=names.get(v.name, v.name)) for v in variables), inner


def _new_list(type_name: str, bindings: Mapping[str, Value | Term]) -> str:
    """Return a type; if it is a variable, the variable whose name the bindings give to it."""
    new = bindings.get(type_name[1:]) if type_name[:1] == "?" else None
    return f"?{new.name}" if isinstance(new, Variable) else type_name


def fresh(name: str, taken: Container[str]) -> str:
    """Return the name with the first number that makes it differ from the names in `taken`."""
    return next(other for n in itertools.count(2) if (other := f"{name}_{n}") not in taken)
