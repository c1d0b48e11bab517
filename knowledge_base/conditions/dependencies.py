"""What a condition depends on: each place in it where a changed fact, number or type can make a difference."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    TypedVariable,
    Variable,
)
from knowledge_base.world.schema import Schema

Kind = Literal["said", "type"]
"""`said`: by facts and numbers, whose names differ; `type`: by the type of things."""

BOTH = 0
"""The polarity of numbers and of what is computed from: any change can make a condition true, or false."""


@dataclass(frozen=True, slots=True)
class Occurrence:
    """One place in a condition that reads a predicate, function or type.

    Attributes:
        kind: what is read.
        name: its name.
        polarity: 1 if more of it can only make the condition true, -1 if only false, else `BOTH`.
        bound: the condition's free variables among the arguments, with the first position of each.
        equal: pairs of positions that hold the same variable.
    """

    kind: Kind
    name: str
    polarity: int
    bound: tuple[tuple[str, int], ...] = ()
    equal: tuple[tuple[int, int], ...] = ()


def occurrences(e: Expression, schema: Schema) -> tuple[Occurrence, ...]:
    """All places in `e` that read the world, each once, in order."""
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
