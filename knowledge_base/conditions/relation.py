"""The installed conditions of one shape, kept up to date by what changes.

What is incremental: a row keeps one witness (all, where each change of them counts) and is true while it has
one. A change that can break a condition is looked up among the arguments the kept witnesses rely on, and only
those witnesses are tested again; a row that lost its last one is searched anew. A change that can make a
condition true is joined with the rest of the condition and the rows that are open, beginning with what the
changed fact binds. What is re-evaluated as a whole: the part under `not` with a quantifier, `imply` and
`forall`, for each row or witness whose bound arguments agree with the change; and all open rows, where the
change binds none of the condition's own variables (`(forall (?c - cup) (clean ?c))`).

A condition that cannot be computed (a division by zero) is not true, and is tried again at every change of
what it reads.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from knowledge_base.conditions.dependencies import occurrences
from knowledge_base.conditions.rows import ROWS, Row, RowsWorld, row_fact
from knowledge_base.conditions.shape import Args, Shape
from knowledge_base.conditions.trigger import Trigger
from knowledge_base.errors import InputError
from knowledge_base.index import FactIndex
from knowledge_base.language.compiler import compile_query, compile_test
from knowledge_base.language.terms import Bindings
from knowledge_base.schema import Schema
from knowledge_base.state import WorldState

Hit = tuple[Trigger, Args, int]
"""What a change does to a shape: where, with which arguments, and 1 for more, -1 for less, 0 for a number."""


class Relation:
    """A shape with its rows."""

    def __init__(self, shape: Shape, schema: Schema) -> None:
        self.shape = shape
        self.triggers = tuple(Trigger(o, shape, schema) for o in occurrences(shape.body, schema))
        self.rows: dict[Args, Row] = {}
        self._test = compile_test(shape.body, schema)
        self._search = compile_query(shape.body, schema, frozenset(shape.params))
        self._joins = not all(t.covers for t in self.triggers)
        self._open = FactIndex()
        self._failed: dict[Row, InputError] = {}
        self._touched: dict[Row, None] = {}

    def row(self, key: Args, world: WorldState) -> Row:
        """The row for these values, evaluated when it is new."""
        row = self.rows.get(key)
        if row is None:
            row = self.rows[key] = Row(key, self.shape.params)
            self._renew(row, world)
        return row

    def want_all(self, row: Row, world: WorldState) -> None:
        """From now on every change of the row's set of witnesses counts."""
        if not row.wants_all:
            row.wants_all = True
            self._renew(row, world)

    def drop(self, row: Row) -> None:
        """Forget the row."""
        for witness in tuple(row.witnesses):
            self._remove(row, witness)
        self._failed.pop(row, None)
        self._open.discard(row_fact(row))
        del self.rows[row.key]

    def error(self, row: Row) -> InputError | None:
        """Why the row cannot be computed, if so."""
        return self._failed.get(row)

    def update(self, hits: list[Hit], world: WorldState) -> Iterable[Row]:
        """Take a change into account that `world` has already; the rows whose witnesses are others now."""
        self._touched = {}
        suspects: dict[tuple[Row, Args], None] = {}
        for trigger, args, sign in hits:
            if sign * trigger.polarity <= 0:
                suspects.update(trigger.relying(args))
        broken = self._break(suspects, world) if suspects else ()
        for row in (*broken, *self._failed):
            self._renew(row, world)
        for trigger, args, sign in hits:
            if sign * trigger.polarity >= 0 and trigger.fits(args):
                self._make(trigger, args, world)
        return self._touched

    def _break(self, suspects: Iterable[tuple[Row, Args]], world: WorldState) -> Iterable[Row]:
        """Drop the witnesses that are none any more; the rows that have to be searched."""
        lost: dict[Row, None] = {}
        for row, witness in suspects:
            if not self._holds(row, witness, world):
                self._remove(row, witness)
                if not row.wants_all:
                    lost[row] = None
        return [row for row in lost if not row.witnesses]

    def _holds(self, row: Row, witness: Args, world: WorldState) -> bool:
        try:
            return self._test(world, {**row.bindings, **dict(zip(self.shape.answers, witness, strict=True))})
        except InputError as error:
            self._failed[row] = error
            return False

    def _make(self, trigger: Trigger, args: Args, world: WorldState) -> None:
        """Find the open rows that the change gives a witness."""
        try:
            if trigger.covers:
                row = self.rows.get(trigger.key(args))
                if row is not None and row.is_open:
                    self._complete(row, trigger, trigger.bindings(args), world)
            elif not trigger.finds:
                for row in self._reached(trigger, args):
                    self._renew(row, world)
            else:
                for found in list(trigger.join(RowsWorld(world, self._open), trigger.bindings(args))):
                    self._add(self.rows[tuple([found[name] for name in self.shape.params])], self._witness(found))
        except InputError:  # some row of those reached cannot be computed; which one shows one by one
            for row in self._reached(trigger, args):
                self._renew(row, world)

    def _reached(self, trigger: Trigger, args: Args) -> list[Row]:
        """The open rows that agree with the change in the parameters it determines."""
        if trigger.covers:
            row = self.rows.get(trigger.key(args))
            return [row] if row is not None and row.is_open else []
        return [self.rows[key] for key in self._open.match(ROWS, trigger.row_pattern(args))]

    def _renew(self, row: Row, world: WorldState) -> None:
        """Search the row as if it were new."""
        try:
            found = dict.fromkeys(self._witness(b) for b in self._few(row, self._search(world, row.bindings)))
            self._failed.pop(row, None)
        except InputError as error:
            found, self._failed[row] = {}, error
        for witness in [w for w in row.witnesses if w not in found]:
            self._remove(row, witness)
        for witness in found:
            self._add(row, witness)
        self._settle(row)

    def _complete(self, row: Row, trigger: Trigger, bindings: Bindings, world: WorldState) -> None:
        """Find what the change, which determines the row, makes a witness of."""
        if not trigger.leaves_open:
            if self._test(world, bindings):
                self._add(row, self._witness(bindings))
            return
        for found in self._few(row, trigger.search(world, bindings)):
            self._add(row, self._witness(found))

    def _few(self, row: Row, found: Iterator[Bindings]) -> list[Bindings]:
        if row.wants_all:
            return list(found)
        first = next(found, None)
        return [] if first is None else [first]

    def _witness(self, bindings: Bindings) -> Args:
        return tuple([bindings[name] for name in self.shape.answers])

    def _add(self, row: Row, witness: Args) -> None:
        if witness in row.witnesses or not row.is_open or row in self._failed:
            return
        row.witnesses[witness] = None
        self._changed(row)
        for trigger in self.triggers:
            trigger.lean(row, witness)

    def _remove(self, row: Row, witness: Args) -> None:
        del row.witnesses[witness]
        self._changed(row)
        for trigger in self.triggers:
            trigger.let_go(row, witness)

    def _changed(self, row: Row) -> None:
        self._touched[row] = None
        self._settle(row)

    def _settle(self, row: Row) -> None:
        """Only open rows take part in joins."""
        if not self._joins:
            return
        if row.is_open:
            self._open.add(row_fact(row))
        else:
            self._open.discard(row_fact(row))

