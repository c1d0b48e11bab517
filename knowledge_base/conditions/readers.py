"""Who reads one predicate, function or type: found by what a change says, for the conditions of all shapes at once.

A change costs one look-up for each set of argument positions at which conditions know their values, however many
conditions and shapes there are. Only what agrees with the change there comes back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from operator import itemgetter
from typing import TYPE_CHECKING

from knowledge_base.facts import Value

if TYPE_CHECKING:
    from knowledge_base.conditions.relation import Relation
    from knowledge_base.conditions.rows import Row
    from knowledge_base.conditions.trigger import Trigger

Args = tuple[Value, ...]
Positions = tuple[int, ...]
Picked = object
"""The values at some positions: one as it is, several as a tuple."""

Relying = dict[Picked, dict[tuple["Row", Args], None]]
Open = dict[Picked, dict["Trigger", dict["Row", None]]]


def picker(positions: Positions) -> Callable[[Args], Picked]:
    """A function that takes the values at these positions."""
    return itemgetter(*positions) if positions else _nothing


class Readers:
    """The conditions that read the same name, by polarity and by the values that they have at some positions.

    Attributes:
        failing: shapes some of whose rows cannot be computed at present; every change is another try.
    """

    def __init__(self) -> None:
        self.failing: dict[Relation, None] = {}
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

    def broken(self, args: Args, sign: int) -> Iterator[tuple[Row, Args]]:
        """The rows with the witnesses that may be none any more."""
        for (polarity, _), (pick, relying) in self._relying.items():
            if relying and sign * polarity <= 0:
                yield from relying.get(pick(args), ())

    def made(self, args: Args, sign: int) -> Iterator[tuple[Trigger, dict[Row, None]]]:
        """The open rows that may get a witness, by the trigger that says how; not to be changed meanwhile."""
        for (polarity, _), (pick, rows) in self._open.items():
            if rows and sign * polarity >= 0:
                found = rows.get(pick(args))
                if found is not None:
                    yield from found.items()


def _nothing(_args: Args) -> Picked:
    return ()
