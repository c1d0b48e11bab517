"""Open rows as a relation of the world, so that a join can start from them or end at them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

from knowledge_base.facts import Content, Value
from knowledge_base.language.checking.vocabulary import Signature
from knowledge_base.language.syntax.expression import TypedVariable
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import FactIndex, WorldState

ROWS = "installed rows"
"""The name of the relation as a predicate; with its blank, no text can declare or write it."""


class RowsWorld:
    """The world with the relation of open rows."""

    def __init__(self, world: WorldState, rows: FactIndex) -> None:
        self._world = world
        self._rows = rows

    @property
    def schema(self) -> Schema:
        """The world's schema, without the rows."""
        return self._world.schema

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true or the row open."""
        return (self._rows if predicate == ROWS else self._world).holds(predicate, args)

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[tuple[Value, ...]]:
        """The facts or open rows that agree with `pattern`."""
        return (self._rows if predicate == ROWS else self._world).match(predicate, pattern)

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """An upper bound of their number."""
        return (self._rows if predicate == ROWS else self._world).estimate(predicate, pattern)

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """The value of the function."""
        return self._world.value(function, args)

    def objects(self, type_name: str) -> list[str]:
        """The objects of that type."""
        return self._world.objects(type_name)

    def type_of(self, name: str) -> str | None:
        """The type of the object."""
        return self._world.type_of(name)


@lru_cache(maxsize=64)
def schema_with_rows(schema: Schema, params: tuple[str, ...]) -> Schema:
    """`schema` with the relation of rows declared; cached, since most shapes name their values alike."""
    rows = Signature(ROWS, tuple(map(TypedVariable, params)))
    return replace(schema, predicates={**schema.predicates, ROWS: rows})
