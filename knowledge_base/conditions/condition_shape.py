"""The shape of a condition: its text without the values in it, so that conditions that differ only there share work.

`(on ?x table7)` and `(on ?y ?t)` with `t = shelf` both have the shape `(on ?A ?P)` and are the rows `(table7)`
and `(shelf)` of one relation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from knowledge_base.facts import Value
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


@dataclass(frozen=True, slots=True)
class Shape:
    """A condition with parameters.

    Attributes:
        body: the condition.
        params: its free variables that stand for values of the text.
        answers: its other free variables; their values are a witness.

    All variables have names that cannot be written, in the order in which they are met.
    """

    body: Expression
    params: tuple[str, ...]
    answers: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Lifted:
    """A condition as a shape with what makes it this one.

    Attributes:
        shape: what it shares with others.
        key: the values of the shape's parameters.
        names: what it calls the shape's answers.
    """

    shape: Shape
    key: Args
    names: tuple[str, ...]


def lifted(e: Expression, params: Mapping[str, Value], schema: Schema) -> Lifted:
    """The shape of `e` with `params` filled in.

    The variables of an outermost `exists` become answers, so that its witness is known.
    """
    lifting = _Lifting()
    body = lifting.expression(_opened(substitute(e, params), schema), {})
    shape = Shape(body, tuple(lifting.values.values()), tuple(lifting.answers.values()))
    return Lifted(shape, tuple(value for _, value in lifting.values), tuple(lifting.answers))


def _opened(e: Expression, schema: Schema) -> Expression:
    """`(exists (?c - cup) ...)` as `(and (cup ?c) ...)`, as long as no name then means two things."""
    ranges: list[Expression] = []
    seen: set[str] = set(free_variables(e))
    while (
        isinstance(e, Exists)
        and seen.isdisjoint(names := {v.name for v in e.variables})
        and all(schema.is_type(t, 1) for v in e.variables for t in v.types)
    ):
        ranges += map(_range, e.variables)
        seen |= names
        e = e.body
    return And((*ranges, e)) if ranges else e


def _range(variable: TypedVariable) -> Expression:
    kinds = tuple(Atom(t, (Variable(variable.name),), place=variable.place) for t in variable.types or ("object",))
    return kinds[0] if len(kinds) == 1 else Or(kinds)


class _Lifting:
    """Puts variables in place of values, the same for the same value, and gives those of the text common names.

    Truth values stay: as keys Python cannot tell them from 0 and 1.
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
