"""Alpha index: the conditions that read one predicate, function or type, found by a change (Rete, Forgy 1982)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from operator import itemgetter
from typing import TYPE_CHECKING

from knowledge_base.facts import Content, Fact, Value
from knowledge_base.language.expression import TypedVariable
from knowledge_base.language.vocabulary import Signature
from knowledge_base.world.index import FactIndex
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

if TYPE_CHECKING:
    from knowledge_base.conditions.join import DeltaJoin, Join


ROWS = "installed rows"
"""The name of the relation as a predicate; nobody can declare or write it."""


class ConditionRow:
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

    def __init__(self, relation: Join, key: Args) -> None:
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


def row_fact(row: ConditionRow) -> Fact:
    """The row as it stands in the relation."""
    return Fact(ROWS, row.key)


@lru_cache(maxsize=64)
def schema_with_rows(schema: Schema, params: tuple[str, ...]) -> Schema:
    """`schema` with the relation of rows declared, for compiling joins with it; most shapes name their values alike."""
    rows = Signature(ROWS, tuple(map(TypedVariable, params)))
    return replace(schema, predicates={**schema.predicates, ROWS: rows})


Args = tuple[Value, ...]
Positions = tuple[int, ...]
Picked = object
"""The values at some positions: one as it is, several as a tuple."""

Relying = dict[Picked, dict[tuple["ConditionRow", Args], None]]
Open = dict[Picked, dict["DeltaJoin", dict["ConditionRow", None]]]


def picker(positions: Positions) -> Callable[[Args], Picked]:
    """A function that takes the values at these positions."""
    return itemgetter(*positions) if positions else _nothing


class AlphaIndex:
    """The conditions that read the same name, by polarity and by the values that they have at some positions.

    Attributes:
        failing: shapes some of whose rows cannot be computed at present; every change is another try.
    """

    def __init__(self) -> None:
        self.failing: dict[Join, None] = {}
        self._relying: dict[tuple[int, Positions], tuple[Callable[[Args], Picked], Relying]] = {}
        self._open: dict[tuple[int, Positions], tuple[Callable[[Args], Picked], Open]] = {}

    def __bool__(self) -> bool:
        """Whether a change could reach anybody."""
        return bool(self.failing) or any(found for _, found in (*self._relying.values(), *self._open.values()))

    def relying_at(self, polarity: int, positions: Positions) -> Relying:
        """Where witnesses are put that rely on facts with certain values at these positions."""
        return self._relying.setdefault((polarity, positions), (picker(positions), {}))[1]

    def open_at(self, polarity: int, positions: Positions) -> Open:
        """Where open rows are put whose parameters stand at these positions."""
        return self._open.setdefault((polarity, positions), (picker(positions), {}))[1]

    def broken(self, args: Args, sign: int) -> Iterator[tuple[ConditionRow, Args]]:
        """The rows with the witnesses that may be none any more."""
        for (polarity, _), (pick, relying) in self._relying.items():
            if relying and sign * polarity <= 0:
                yield from relying.get(pick(args), ())

    def made(self, args: Args, sign: int) -> Iterator[tuple[DeltaJoin, dict[ConditionRow, None]]]:
        """The open rows that may get a witness, by the trigger that says how; not to be changed meanwhile."""
        for (polarity, _), (pick, rows) in self._open.items():
            if rows and sign * polarity >= 0:
                found = rows.get(pick(args))
                if found is not None:
                    yield from found.items()


def _nothing(_args: Args) -> Picked:
    return ()
