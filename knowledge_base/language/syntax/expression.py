"""Conditions and terms as frozen values, without a world.

The language has the conditions of PDDL 2.1 (Fox & Long 2003), `!=`, quoted text and truth values; a type is also
a unary predicate. Comparison ignores places, so the same text at two places gives equal expressions.
"""

from __future__ import annotations

import itertools
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import overload

from knowledge_base.errors import Place
from knowledge_base.facts import GEOMETRY, Value
from knowledge_base.spelling import is_plain_name


@dataclass(frozen=True, slots=True)
class Located:
    """Base of all values read from text; `place` is for messages only."""

    place: Place | None = field(default=None, compare=False, repr=False, kw_only=True)


@dataclass(frozen=True, slots=True)
class TypedVariable(Located):
    """A parameter or quantified variable; no types or `object` means any type, several mean `either`."""

    name: str
    types: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.types == ("object",):
            object.__setattr__(self, "types", ())


@dataclass(frozen=True, slots=True)
class Variable(Located):
    """`?x`, by its name without the question mark; `?event.item` has the name `event.item`."""

    name: str


@dataclass(frozen=True, slots=True)
class Constant(Located):
    """An object's name, a number, a truth value, or text in quotes.

    Text that needs quotes (blanks, upper case) is quoted even without `quoted`, so that printing and reading give
    the same value again. Quoted text names the object of exactly that spelling.
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
    """Computed from numbers: `+ - * /`, where `-` with one argument negates; `geometry` puts them in a row."""

    operator: str
    args: tuple[Term, ...]


Term = Variable | Constant | Call | Arithmetic


@dataclass(frozen=True, slots=True)
class Atom(Located):
    """A predicate of its arguments, or a type of one: `(on ?o table)`, `(cup ?o)`."""

    predicate: str
    args: tuple[Term, ...] = ()


@dataclass(frozen=True, slots=True)
class Not(Located):
    """True when `body` is not."""

    body: Expression


@dataclass(frozen=True, slots=True)
class And(Located):
    """True when all parts are; `(and)` is true."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Or(Located):
    """True when some part is; `(or)` is false."""

    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Imply(Located):
    """False only when `premise` is true and `conclusion` is not."""

    premise: Expression
    conclusion: Expression


@dataclass(frozen=True, slots=True)
class Exists(Located):
    """True when `body` is for some choice of known objects."""

    variables: tuple[TypedVariable, ...]
    body: Expression


@dataclass(frozen=True, slots=True)
class Forall(Located):
    """True when `body` is for all choices of known objects."""

    variables: tuple[TypedVariable, ...]
    body: Expression


@dataclass(frozen=True, slots=True)
class Comparison(Located):
    """`= != < <= > >=`; the first two compare anything, the others numbers."""

    operator: str
    left: Term
    right: Term


Expression = Atom | Not | And | Or | Imply | Exists | Forall | Comparison

TRUE = And(())
"""`(and)`, the condition that always holds."""

COMPARISONS = ("=", "!=", "<", "<=", ">", ">=")
ARITHMETIC = ("+", "-", "*", "/")
COMPUTING = (*ARITHMETIC, GEOMETRY)
"""The words that open a term and are not functions."""
KEYWORDS = ("and", "or", "not", "imply", "exists", "forall", *COMPARISONS)
"""The words that open a condition and are not predicates."""


def variables_in_order(e: Expression | Term) -> Iterator[str]:
    """Names of the free variables from left to right, with repetitions."""
    match e:
        case Variable(name):
            yield name
        case Constant():
            return
        case Exists(variables, body) | Forall(variables, body):
            bound = {v.name for v in variables}
            yield from (name for name in variables_in_order(body) if name not in bound)
        case _:
            for part in parts_of(e):
                yield from variables_in_order(part)


def parts_of(e: Expression | Term) -> tuple[Expression | Term, ...]:
    """The expressions and terms that `e` directly consists of."""
    match e:
        case Atom(_, args) | Call(_, args) | Arithmetic(_, args):
            return args
        case And(parts) | Or(parts):
            return parts
        case Not(body) | Exists(_, body) | Forall(_, body):
            return (body,)
        case Imply(first, second) | Comparison(_, first, second):
            return (first, second)
        case _:
            return ()


def free_variables(e: Expression | Term) -> frozenset[str]:
    """The names of the variables in `e` that no quantifier binds."""
    return frozenset(variables_in_order(e))


def variable_place(e: Expression | Term, name: str) -> Place | None:
    """The place of the first `?name` in `e`."""
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
    """`e` with the free variables in `bindings` replaced by values or terms; quantified variables shadow.

    Names in `bindings` that are not free in `e` are ignored. Places are kept. A quantified variable that a new term
    mentions gets a fresh name.
    """
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
            variables, inner = _entered(variables, body, bindings)
            made = replace(e, variables=variables, body=substitute(body, inner))
    return made


def _entered(
    variables: tuple[TypedVariable, ...], body: Expression, bindings: Mapping[str, Value | Term]
) -> tuple[tuple[TypedVariable, ...], dict[str, Value | Term]]:
    """A quantifier's variables and the bindings inside; a variable that a new term mentions gets a fresh name."""
    own, free = {v.name for v in variables}, free_variables(body)
    inner = {name: value for name, value in bindings.items() if name in free and name not in own}
    met = {name for value in inner.values() if isinstance(value, Term) for name in variables_in_order(value)}
    if own.isdisjoint(met):
        return variables, inner
    names = {name: fresh(name, own | free | met) for name in own & met}
    inner |= {name: Variable(new) for name, new in names.items()}
    return tuple(replace(v, name=names.get(v.name, v.name)) for v in variables), inner


def fresh(name: str, taken: Container[str]) -> str:
    """The name with the first number that makes it differ from those `taken`."""
    return next(other for n in itertools.count(2) if (other := f"{name}_{n}") not in taken)
