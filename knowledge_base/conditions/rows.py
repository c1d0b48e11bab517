"""The conditions of one shape as rows of a relation, and a world in which that relation can be looked up."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from knowledge_base.facts import Content, Fact, Value
from knowledge_base.language.expression import TypedVariable
from knowledge_base.language.vocabulary import Signature
from knowledge_base.world.index import FactIndex
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

if TYPE_CHECKING:
    from knowledge_base.conditions.relation import Relation
    from knowledge_base.conditions.shape import Args

ROWS = "installed rows"
"""The name of the relation as a predicate; nobody can declare or write it."""


class Row:
    """All installed conditions of one shape with the same values.

    Attributes:
        relation: the rows of that shape.
        key: the values of the shape's parameters.
        bindings: the same, by name.
        witnesses: choices for the shape's answers that make it true: one is kept, or all (`wants_all`).
        wants_all: whether each change of the set of witnesses counts.
        is_listed: whether changes find it among the open rows.
    """

    __slots__ = ("bindings", "is_listed", "key", "relation", "wants_all", "witnesses")

    def __init__(self, relation: Relation, key: Args) -> None:
        self.relation = relation
        self.key = key
        self.bindings: dict[str, Value] = dict(zip(relation.shape.params, key, strict=True))
        self.is_listed = False
        self.witnesses: dict[Args, None] = {}
        self.wants_all = False

    @property
    def truth(self) -> bool:
        """Whether there is a witness."""
        return bool(self.witnesses)

    @property
    def is_open(self) -> bool:
        """Whether another witness would make a difference."""
        return self.wants_all or not self.witnesses

    @property
    def witness(self) -> Args | None:
        """A choice for the shape's answers that makes it true."""
        return next(iter(self.witnesses), None)


class RowsWorld:
    """The world with a relation of open rows, so that a join can start from them or end at them."""

    def __init__(self, world: WorldState, rows: FactIndex) -> None:
        self._world = world
        self._rows = rows

    @property
    def schema(self) -> Schema:
        """That of the world, which does not know the rows."""
        return self._world.schema

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true or the row open."""
        return (self._rows if predicate == ROWS else self._world).holds(predicate, args)

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[tuple[Value, ...]]:
        """The facts or open rows that agree with `pattern`."""
        return (self._rows if predicate == ROWS else self._world).match(predicate, pattern)

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """At most how many they are."""
        return (self._rows if predicate == ROWS else self._world).estimate(predicate, pattern)

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """What the function is worth."""
        return self._world.value(function, args)

    def objects(self, type_name: str) -> list[str]:
        """The things of that type."""
        return self._world.objects(type_name)

    def type_of(self, name: str) -> str | None:
        """The thing's type."""
        return self._world.type_of(name)


def row_fact(row: Row) -> Fact:
    """The row as it stands in the relation."""
    return Fact(ROWS, row.key)


@lru_cache(maxsize=64)
def schema_with_rows(schema: Schema, params: tuple[str, ...]) -> Schema:
    """`schema` with the relation of rows declared, for compiling joins with it; most shapes name their values alike."""
    rows = Signature(ROWS, tuple(map(TypedVariable, params)))
    return replace(schema, predicates={**schema.predicates, ROWS: rows})
