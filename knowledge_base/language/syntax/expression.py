"""Conditions as frozen values: what a text means, without saying on which world.

The forms are those of PDDL 2.1 conditions (Fox & Long 2003) plus `!=`, quoted text and truth values; a type
is also a unary predicate. Two expressions are equal when they say the same, wherever they were written:
places take no part in comparison.
"""

from __future__ import annotations

import itertools
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

from knowledge_base.content import GEOMETRY
from knowledge_base.errors import Place
from knowledge_base.facts import Value
from knowledge_base.spelling import is_plain_name

Bound = TypeVar("Bound")


@dataclass(frozen=True, slots=True)
class Located:
    """Base of everything that was written somewhere; `place` is for messages only."""

    place: Place | None = field(default=None, compare=False, repr=False, kw_only=True)


@dataclass(frozen=True, slots=True)
class TypedVariable(Located):
    """A parameter or quantified variable; no types or `object` means anything, several mean `either`."""

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

    Text that cannot stand without quotes (blanks, upper case) is quoted whatever `quoted` says, so that
    printing and reading give the same value again. Quoted text names the object of exactly that spelling.
    """

    value: Value
    quoted: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.value, str) and not is_plain_name(self.value):
            object.__setattr__(self, "quoted", True)


@dataclass(frozen=True, slots=True)
class Call(Located):
    """What a function is worth: `(failures ?item)`."""

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
    """Names of the free variables as they are met reading from left to right; repeated ones again."""
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
    """Where the variable `name` is first written in `e`."""
    if isinstance(e, Variable):
        return e.place if e.name == name else None
    found = (variable_place(part, name) for part in parts_of(e))
    return next((place for place in found if place is not None), None)


def substitute(e: Expression, bindings: Mapping[str, Value | Term]) -> Expression:
    """`e` with the free variables in `bindings` replaced by values or terms; quantified ones shadow.

    Names in `bindings` that do not occur free in `e` are ignored. Places are kept. A variable in a term must not meet
    a quantifier of its name in `e`, see `quantified`.
    """
    match e:
        case Atom():
            return replace(e, args=_all(e.args, bindings))
        case Not(body):
            return replace(e, body=substitute(body, bindings))
        case And(parts) | Or(parts):
            return replace(e, parts=tuple(substitute(p, bindings) for p in parts))
        case Imply(premise, conclusion):
            return replace(e, premise=substitute(premise, bindings), conclusion=substitute(conclusion, bindings))
        case Exists() | Forall():
            return replace(e, body=substitute(e.body, unshadowed(e.variables, bindings)))
        case Comparison(_, left, right):
            return replace(e, left=substitute_term(left, bindings), right=substitute_term(right, bindings))


def substitute_term(term: Term, bindings: Mapping[str, Value | Term]) -> Term:
    """`term` with the variables in `bindings` replaced by values or terms."""
    match term:
        case Variable(name) if name in bindings:
            value = bindings[name]
            return value if isinstance(value, Term) else Constant(value, place=term.place)
        case Call(_, args) | Arithmetic(_, args):
            return replace(term, args=_all(args, bindings))
        case _:
            return term


def quantified(e: Expression) -> frozenset[str]:
    """The names of the variables that quantifiers in `e` bind."""
    inner = frozenset[str]().union(*(quantified(part) for part in parts_of(e) if isinstance(part, Expression)))
    return inner | {v.name for v in e.variables} if isinstance(e, Exists | Forall) else inner


def unshadowed(variables: tuple[TypedVariable, ...], bindings: Mapping[str, Bound]) -> dict[str, Bound]:
    """The bindings that are still visible inside a quantifier over `variables`."""
    own = {v.name for v in variables}
    return {name: value for name, value in bindings.items() if name not in own}


def _all(args: tuple[Term, ...], bindings: Mapping[str, Value | Term]) -> tuple[Term, ...]:
    return tuple(substitute_term(a, bindings) for a in args)


def fresh(name: str, taken: Container[str]) -> str:
    """The name with a number behind it, so that it is none of those taken."""
    return next(other for n in itertools.count(2) if (other := f"{name}_{n}") not in taken)


def renamed(e: Expression, names: Mapping[str, str]) -> Expression:
    """`e` with other names for free variables; a quantified variable that a new name would meet gets out of its way."""
    match e:
        case Atom(_, args):
            return replace(e, args=tuple(renamed_term(a, names) for a in args))
        case Not(body):
            return replace(e, body=renamed(body, names))
        case And(parts) | Or(parts):
            return replace(e, parts=tuple(renamed(p, names) for p in parts))
        case Imply(premise, conclusion):
            return replace(e, premise=renamed(premise, names), conclusion=renamed(conclusion, names))
        case Comparison(_, left, right):
            return replace(e, left=renamed_term(left, names), right=renamed_term(right, names))
        case Exists(variables, body) | Forall(variables, body):
            own = {v.name for v in variables}
            outer = {old: new for old, new in names.items() if old not in own and old in free_variables(body)}
            taken = own | free_variables(body) | set(outer.values())
            moved = {old: fresh(old, taken) for old in own & set(outer.values())}
            variables = tuple(replace(v, name=moved.get(v.name, v.name)) for v in variables)
            return replace(e, variables=variables, body=renamed(body, {**outer, **moved}))


def renamed_term(term: Term, names: Mapping[str, str]) -> Term:
    """`term` with other names for variables."""
    match term:
        case Variable(name) if name in names:
            return replace(term, name=names[name])
        case Call(_, args) | Arithmetic(_, args):
            return replace(term, args=tuple(renamed_term(a, names) for a in args))
        case _:
            return term
