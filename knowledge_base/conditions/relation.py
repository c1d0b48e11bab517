"""The installed conditions of one shape, kept up to date by what changes.

What is incremental: a row keeps one witness (all, where each change of them counts) and is true while it has
one. A change that can break a condition is looked up among the arguments the kept witnesses rely on, and only
those witnesses are tested again; a row that lost its last one is searched anew. A change that can make a
condition true is looked up among the open rows whose parameters agree with it, of all shapes at once (`readers`),
and joined with the rest of the condition and those rows, beginning with what the changed fact binds. What is
re-evaluated as a whole: the part under `not` with a quantifier, `imply` and `forall`, for each row or witness
whose bound arguments agree with the change; and all open rows, where the change binds none of the condition's own
variables (`(forall (?c - cup) (clean ?c))`).

A condition that cannot be computed (a division by zero) is not true, and is tried again at every change of
what it reads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from knowledge_base.conditions.dependencies import Occurrence, occurrences
from knowledge_base.conditions.readers import Readers
from knowledge_base.conditions.rows import Row, RowsWorld, row_fact
from knowledge_base.conditions.shape import Args, Shape
from knowledge_base.conditions.trigger import Trigger
from knowledge_base.errors import InputError
from knowledge_base.language.compiler import compile_query, compile_test
from knowledge_base.language.terms import Bindings
from knowledge_base.world.index import FactIndex
from knowledge_base.world.state import WorldState


class Relation:
    """A shape with its rows.

    Args:
        shape: the conditions without their values.
        world: what they are about; it has a change already when it is told here.
        readers: all who read what an occurrence is about.
        changed: gets the rows whose witnesses become others.
    """

    def __init__(
        self, shape: Shape, world: WorldState, readers: Callable[[Occurrence], Readers], changed: dict[Row, None]
    ) -> None:
        schema = world.schema
        self.shape = shape
        self.rows: dict[Args, Row] = {}
        self.world = world
        self._triggers = tuple(Trigger(o, self, readers(o)) for o in occurrences(shape.body, schema))
        self._test = compile_test(shape.body, schema)
        self._search = compile_query(shape.body, schema, frozenset(shape.params))
        self._joins = not all(t.covers for t in self._triggers)
        self._open = FactIndex()
        self._rows_world = RowsWorld(world, self._open)
        self._failed: dict[Row, InputError] = {}
        self._changed = changed

    def row(self, key: Args) -> Row:
        """The row for these values, evaluated when it is new."""
        row = self.rows.get(key)
        if row is None:
            row = self.rows[key] = Row(self, key)
            self.renew(row)
        return row

    def want_all(self, row: Row) -> None:
        """From now on every change of the row's set of witnesses counts."""
        if not row.wants_all:
            row.wants_all = True
            self.renew(row)

    def drop(self, row: Row) -> None:
        """Forget the row."""
        for witness in tuple(row.witnesses):
            self._remove(row, witness)
        self._mend(row)
        self._list(row, is_open=False)
        del self.rows[row.key]

    def error(self, row: Row) -> InputError | None:
        """Why the row cannot be computed, if so."""
        return self._failed.get(row)

    @property
    def failed(self) -> list[Row]:
        """The rows that cannot be computed."""
        return list(self._failed)

    def loses(self, row: Row, witness: Args) -> bool:
        """Drop a witness that is none any more; whether the row has to be searched then."""
        try:
            if self._test(self.world, {**row.bindings, **dict(zip(self.shape.answers, witness, strict=True))}):
                return False
        except InputError as error:
            self._fail(row, error)
        self._remove(row, witness)
        return not row.witnesses and not row.wants_all

    def make(self, trigger: Trigger, args: Args, rows: dict[Row, None]) -> None:
        """Find what a change that the trigger admits makes true of open rows that agree with it in their parameters."""
        bindings = trigger.bindings(args)
        try:
            if len(rows) == 1 or not trigger.finds:
                for row in tuple(rows):
                    self._complete(row, trigger, bindings)
            else:
                for found in list(trigger.join(self._rows_world, bindings)):
                    self._add(self.rows[tuple([found[name] for name in self.shape.params])], self._witness(found))
        except InputError:  # some row of those reached cannot be computed; which one shows one by one
            for row in tuple(rows):
                self.renew(row)

    def renew(self, row: Row) -> None:
        """Search the row as if it were new."""
        try:
            found = dict.fromkeys(self._witness(b) for b in self._few(row, self._search(self.world, row.bindings)))
            self._mend(row)
        except InputError as error:
            found = {}
            self._fail(row, error)
        for witness in [w for w in row.witnesses if w not in found]:
            self._remove(row, witness)
        for witness in found:
            self._add(row, witness)
        self._list(row, is_open=row.is_open)

    def _complete(self, row: Row, trigger: Trigger, bindings: Bindings) -> None:
        """Find what the change makes a witness of the row."""
        together = {**row.bindings, **bindings}
        if not trigger.leaves_open:
            if self._test(self.world, together):
                self._add(row, self._witness(together))
            return
        for found in self._few(row, trigger.search(self.world, together)):
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
        for trigger in self._triggers:
            trigger.lean(row, witness)
        self._has_changed(row)

    def _remove(self, row: Row, witness: Args) -> None:
        del row.witnesses[witness]
        for trigger in self._triggers:
            trigger.let_go(row, witness)
        self._has_changed(row)

    def _has_changed(self, row: Row) -> None:
        self._changed[row] = None
        self._list(row, is_open=row.is_open)

    def _list(self, row: Row, *, is_open: bool) -> None:
        """Only open rows are found by what can make them true and take part in joins."""
        if row.is_listed is is_open:
            return
        row.is_listed = is_open
        for trigger in self._triggers:
            if is_open:
                trigger.open(row)
            else:
                trigger.close(row)
        if self._joins and is_open:
            self._open.add(row_fact(row))
        elif self._joins:
            self._open.discard(row_fact(row))

    def _fail(self, row: Row, error: InputError) -> None:
        self._failed[row] = error
        for trigger in self._triggers:
            trigger.readers.failing[self] = None

    def _mend(self, row: Row) -> None:
        if self._failed.pop(row, None) is not None and not self._failed:
            for trigger in self._triggers:
                trigger.readers.failing.pop(self, None)
