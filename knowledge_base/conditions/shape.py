"""The shape of a condition: its text without the values in it, so that conditions that differ only there share work.

`(on ?x table7)` and `(on ?x ?t)` with `t = shelf` both have the shape `(on ?x ?P)` and are the rows `(table7)`
and `(shelf)` of one relation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from knowledge_base.facts import Value
from knowledge_base.language.expression import (
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
    variables_in_order,
)
from knowledge_base.schema import Schema

Args = tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Shape:
    """A condition with parameters.

    Attributes:
        body: the condition.
        params: its free variables that stand for values of the text; such names cannot be written.
        answers: its other free variables; their values are a witness.
    """

    body: Expression
    params: tuple[str, ...]
    answers: tuple[str, ...]


def lifted(e: Expression, params: Mapping[str, Value], schema: Schema) -> tuple[Shape, Args]:
    """The shape of `e` with `params` filled in, and the values of the shape's parameters.

    The variables of an outermost `exists` become answers, so that its witness is known.
    """
    lifting = _Lifting()
    body = lifting.expression(_opened(substitute(e, params), schema))
    names = tuple(lifting.names.values())
    answers = dict.fromkeys(name for name in variables_in_order(body) if name not in names)
    return Shape(body, names, tuple(answers)), tuple(value for _, value in lifting.names)


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
    """Puts variables in place of values, the same for the same value.

    Truth values stay: as keys Python cannot tell them from 0 and 1.
    """

    def __init__(self) -> None:
        self.names: dict[tuple[type, Value], str] = {}

    def expression(self, e: Expression) -> Expression:
        match e:
            case Atom(_, args):
                return replace(e, args=self.terms(args))
            case Not(body) | Exists(_, body) | Forall(_, body):
                return replace(e, body=self.expression(body))
            case And(parts) | Or(parts):
                return replace(e, parts=tuple([self.expression(p) for p in parts]))
            case Imply(premise, conclusion):
                return replace(e, premise=self.expression(premise), conclusion=self.expression(conclusion))
            case Comparison(_, left, right):
                return replace(e, left=self.term(left), right=self.term(right))

    def terms(self, terms: tuple[Term, ...]) -> tuple[Term, ...]:
        return tuple([self.term(t) for t in terms])

    def term(self, term: Term) -> Term:
        match term:
            case Constant(value) if not isinstance(value, bool):
                name = self.names.setdefault((type(value), value), f"value {len(self.names)}")
                return Variable(name, place=term.place)
            case Call(_, args) | Arithmetic(_, args):
                return replace(term, args=self.terms(args))
            case _:
                return term
