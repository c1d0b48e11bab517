"""Shape of a condition: its text without values; conditions that differ only in their values share one join.

`(on ?x table7)` and `(on ?y ?t)` with `t = shelf` both have the shape `(on ?A ?P)`. Both conditions are rows of one
join: `(table7)` and `(shelf)`. The occurrences of a shape are the places where a change can affect the condition.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from knowledge_base.facts import Value
from knowledge_base.language.checking.binding import object_variables
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    TypedVariable,
    Variable,
    free_variables,
    substitute,
)
from knowledge_base.world.schema import Schema

Args = tuple[Value, ...]
Kind = Literal["said", "type"]
"""Facts and values of functions (`said`), whose names are distinct; or the types of objects (`type`)."""

BOTH = 0
"""Polarity of values and of the inputs of computed predicates.

Any change of a value or input can make a condition true or false.
"""


@dataclass(frozen=True, slots=True)
class Shape:
    """A condition whose values are replaced by parameters.

    Attributes:
        body: the condition.
        params: the free variables that replace values of the text.
        answers: the other free variables; their values are a witness.

    All variables have generated names that no text can contain, numbered by their order.
    """

    body: Expression
    params: tuple[str, ...]
    answers: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Lifted:
    """A condition as a shape with the values and names of this condition.

    Attributes:
        shape: the part that this condition shares with others.
        key: the values of the shape's parameters.
        names: the names that this condition has for the shape's answers.
    """

    shape: Shape
    key: Args
    names: tuple[str, ...]


def lifted(e: Expression, params: Mapping[str, Value], schema: Schema) -> Lifted:
    """Return the shape of `e`, with its values and names, after the substitution of `params`.

    The variables of an outermost `exists` become answers, so that their values are part of the witness.
    """
    lifting = _Lifting()
    body = lifting.expression(_open(substitute(e, params), schema), {})
    shape = Shape(body, tuple(lifting.values.values()), tuple(lifting.answers.values()))
    return Lifted(shape, tuple(value for _, value in lifting.values), tuple(lifting.answers))


def _open(e: Expression, schema: Schema) -> Expression:
    """Return `(exists (?c - cup) ...)` as `(and (cup ?c) ...)`, unless a name would then have two meanings."""
    ranges: list[Expression] = []
    seen: set[str] = set(free_variables(e))
    while (
        isinstance(e, Exists)
        and seen.isdisjoint(names := {v.name for v in e.variables})
        and all(schema.is_type(t, 1) for v in e.variables for t in v.types)
    ):
        ranges += map(_range, object_variables(e.variables, e.body, schema))
        seen |= names
        e = e.body
    return And((*ranges, e)) if ranges else e


def _range(variable: TypedVariable) -> Expression:
    kinds = tuple(Atom(t, (Variable(variable.name),), place=variable.place) for t in variable.types or ("object",))
    return kinds[0] if len(kinds) == 1 else Or(kinds)


class _Lifting:
    """Replacement of each value by a variable, and of each variable of the text by a common name.

    Truth values are not replaced: as dictionary keys they would equal 0 and 1.
    """

    def __init__(self) -> None:
        self.values: dict[tuple[type, Value], str] = {}
        self.answers: dict[str, str] = {}

    def expression(self, e: Expression, scope: Mapping[str, str]) -> Expression:
        match e:
            case Atom(_, args):
                return replace(e, args=self.terms(args, scope))
            case Not(body):
                return replace(e, body=self.expression(body, scope))
            case Exists(variables, body) | Forall(variables, body):
                own = {v.name: f"chosen {n}" for n, v in enumerate(variables, len(scope))}
                named = tuple([replace(v, name=own[v.name]) for v in variables])
                return replace(e, variables=named, body=self.expression(body, {**scope, **own}))
            case And(parts) | Or(parts):
                return replace(e, parts=tuple([self.expression(p, scope) for p in parts]))
            case Imply(premise, conclusion):
                premise = self.expression(premise, scope)
                return replace(e, premise=premise, conclusion=self.expression(conclusion, scope))
            case Comparison(_, left, right):
                return replace(e, left=self.term(left, scope), right=self.term(right, scope))

    def terms(self, terms: tuple[Term, ...], scope: Mapping[str, str]) -> tuple[Term, ...]:
        return tuple([self.term(t, scope) for t in terms])

    def term(self, term: Term, scope: Mapping[str, str]) -> Term:
        match term:
            case Constant(value) if not isinstance(value, bool):
                name = self.values.setdefault((type(value), value), f"value {len(self.values)}")
                return Variable(name, place=term.place)
            case Variable(name):
                common = scope.get(name) or self.answers.setdefault(name, f"answer {len(self.answers)}")
                return Variable(common, place=term.place)
            case Call(_, args) | Arithmetic(_, args):
                return replace(term, args=self.terms(args, scope))
            case _:
                return term


@dataclass(frozen=True, slots=True)
class Occurrence:
    """One place in a condition that reads a predicate, function or type.

    Attributes:
        kind: the kind of `name`.
        name: name of the predicate, function or type.
        polarity: 1 if additional facts can only make the condition true; -1 if only false; else `BOTH`.
        bound: the free variables of the condition among the arguments, each with its first position.
        equal: pairs of argument positions with the same variable.
    """

    kind: Kind
    name: str
    polarity: int
    bound: tuple[tuple[str, int], ...] = ()
    equal: tuple[tuple[int, int], ...] = ()


def occurrences(e: Expression, schema: Schema) -> tuple[Occurrence, ...]:
    """Return the occurrences in `e`, in the order of the text and without duplicates."""
    return tuple(dict.fromkeys(_Walk(schema).expression(e, 1, frozenset())))


class _Walk:
    def __init__(self, schema: Schema) -> None:
        self._schema = schema

    def expression(self, e: Expression, polarity: int, hidden: frozenset[str]) -> Iterator[Occurrence]:
        match e:
            case Atom(name, args) if name in self._schema.computed:
                for read in self._schema.computed[name].inputs(args):
                    if isinstance(read, Atom):
                        yield from self.expression(read, BOTH, hidden)
                    else:
                        yield from self.numbers((read,), hidden)
            case Atom(name, args):
                kind: Kind = "type" if self._schema.is_type(name, len(args)) else "said"
                yield _occurrence(kind, name, polarity, args, hidden)
                yield from self.numbers(args, hidden)
            case Comparison(_, left, right):
                yield from self.numbers((left, right), hidden)
            case Not(body):
                yield from self.expression(body, -polarity, hidden)
            case And(parts) | Or(parts):
                for part in parts:
                    yield from self.expression(part, polarity, hidden)
            case Imply(premise, conclusion):
                yield from self.expression(premise, -polarity, hidden)
                yield from self.expression(conclusion, polarity, hidden)
            case Exists(variables, body):
                yield from _ranges(variables, polarity)
                yield from self.expression(body, polarity, hidden.union(v.name for v in variables))
            case Forall(variables, body):
                yield from _ranges(variables, -polarity)
                yield from self.expression(body, polarity, hidden.union(v.name for v in variables))

    def numbers(self, terms: tuple[Term, ...], hidden: frozenset[str]) -> Iterator[Occurrence]:
        for term in terms:
            if isinstance(term, Call):
                yield _occurrence("said", term.function, BOTH, term.args, hidden)
            if isinstance(term, Call | Arithmetic):
                yield from self.numbers(term.args, hidden)


def _ranges(variables: tuple[TypedVariable, ...], polarity: int) -> Iterator[Occurrence]:
    for variable in variables:
        for type_name in variable.types or ("object",):
            yield Occurrence("type", type_name, polarity)


def _occurrence(kind: Kind, name: str, polarity: int, args: tuple[Term, ...], hidden: frozenset[str]) -> Occurrence:
    first: dict[str, int] = {}
    equal: list[tuple[int, int]] = []
    for position, arg in enumerate(args):
        if isinstance(arg, Variable) and first.setdefault(arg.name, position) != position:
            equal.append((first[arg.name], position))
    bound = tuple((variable, position) for variable, position in first.items() if variable not in hidden)
    return Occurrence(kind, name, polarity, bound, tuple(equal))
