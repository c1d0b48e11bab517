"""Alpha index: the conditions that read one predicate, function or type, found by a change (Rete, Forgy 1982)."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from operator import itemgetter
from typing import Generic, TypeVar

from knowledge_base.conditions.condition_shape import Args

Row = TypeVar("Row", bound=Hashable)
DeltaJoin = TypeVar("DeltaJoin", bound=Hashable)
Positions = tuple[int, ...]
Picked = object
"""The values at some positions: one unchanged, several as a tuple."""
Relying = dict[Picked, dict[tuple[Row, Args], None]]
"""Rows and witnesses by the values that the facts they rely on have."""
Open = dict[Picked, dict[DeltaJoin, dict[Row, None]]]
"""Open rows by the values of their parameters, and by the delta join that finds their witnesses."""


def picker(positions: Positions) -> Callable[[Args], Picked]:
    """A function that takes the values at these positions."""
    return itemgetter(*positions) if positions else _nothing


class AlphaIndex(Generic[Row, DeltaJoin]):
    """The rows that read the same name, by polarity and by their values at some positions.

    Attributes:
        failing: rows without a truth value, because of an error; every change tries them again.
    """

    def __init__(self) -> None:
        self.failing: dict[Row, None] = {}
        self._relying: dict[tuple[int, Positions], tuple[Callable[[Args], Picked], Relying[Row]]] = {}
        self._open: dict[tuple[int, Positions], tuple[Callable[[Args], Picked], Open[DeltaJoin, Row]]] = {}

    def __bool__(self) -> bool:
        """Whether a change can reach any row."""
        return bool(self.failing) or any(found for _, found in (*self._relying.values(), *self._open.values()))

    def relying_at(self, polarity: int, positions: Positions) -> Relying[Row]:
        """The place for witnesses that rely on facts with certain values at these positions."""
        return self._relying.setdefault((polarity, positions), (picker(positions), {}))[1]

    def open_at(self, polarity: int, positions: Positions) -> Open[DeltaJoin, Row]:
        """The place for open rows whose parameters are at these positions."""
        return self._open.setdefault((polarity, positions), (picker(positions), {}))[1]

    def broken(self, args: Args, sign: int) -> Iterator[tuple[Row, Args]]:
        """The rows with the witnesses that a change may end."""
        for (polarity, _), (pick, relying) in self._relying.items():
            if relying and sign * polarity <= 0:
                yield from relying.get(pick(args), ())

    def made(self, args: Args, sign: int) -> Iterator[tuple[DeltaJoin, dict[Row, None]]]:
        """The open rows that may get a witness, by delta join; do not change the index during the iteration."""
        for (polarity, _), (pick, rows) in self._open.items():
            if rows and sign * polarity >= 0:
                found = rows.get(pick(args))
                if found is not None:
                    yield from found.items()


def _nothing(_args: Args) -> Picked:
    return ()
