"""Join of the installed conditions of one shape, kept up to date by what changes (Rete, Forgy 1982)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

from knowledge_base.conditions.alpha_index import AlphaIndex, picker
from knowledge_base.conditions.condition_shape import Args, Shape
from knowledge_base.conditions.dependencies import Occurrence, occurrences
from knowledge_base.conditions.open_rows import ROWS, RowsWorld, schema_with_rows
from knowledge_base.errors import InputError
from knowledge_base.facts import Fact, Value
from knowledge_base.language.evaluation.compiler import compile_query, compile_test
from knowledge_base.language.evaluation.lookups import Search, conjuncts
from knowledge_base.language.evaluation.terms import Bindings, Test
from knowledge_base.language.syntax.expression import And, Atom, Variable, free_variables
from knowledge_base.world.state import FactIndex, WorldState


class ConditionRow:
    """All installed conditions of one shape with the same values.

    Attributes:
        relation: the join of that shape.
        key: the values of the shape's parameters.
        bindings: the same, by name.
        witnesses: choices for the shape's answers that make it true: one is kept, or all (`wants_all`).
        wants_all: whether each change of the set of witnesses counts.
        is_listed: whether changes find it among the open rows.
        error: the error that leaves it without a truth value, if any.
    """

    __slots__ = ("bindings", "error", "is_listed", "key", "relation", "wants_all", "witnesses")

    def __init__(self, relation: Join, key: Args) -> None:
        self.relation = relation
        self.key = key
        self.bindings: dict[str, Value] = dict(zip(relation.shape.params, key, strict=True))
        self.is_listed = False
        self.error: InputError | None = None
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


class DeltaJoin:
    """An occurrence in a shape; it puts the rows and witnesses of the shape into the alpha index.

    Attributes:
        relation: the join of the shape.
        readers: the index of the name that it reads.
        covers: whether a change determines all parameters.
        finds: whether a change determines some of the answers.
        leaves_open: whether some of them stay undetermined.
    """

    def __init__(self, occurrence: Occurrence, relation: Join, readers: ConditionIndex) -> None:
        shape = relation.shape
        positions = dict(occurrence.bound)
        columns = {name: i for i, name in enumerate((*shape.params, *shape.answers))}
        params = sorted((positions[name], columns[name]) for name in shape.params if name in positions)
        everything = sorted((position, columns[name]) for name, position in positions.items())
        self.relation = relation
        self.readers = readers
        self.covers = positions.keys() >= set(shape.params)
        self.finds = any(name in positions for name in shape.answers)
        self.leaves_open = not all(name in positions for name in shape.answers)
        self._occurrence = occurrence
        self._relying = readers.relying_at(occurrence.polarity, tuple(position for position, _ in everything))
        self._relied_on = picker(tuple(column for _, column in everything))
        self._open = readers.open_at(occurrence.polarity, tuple(position for position, _ in params))
        self._known = picker(tuple(column for _, column in params))

    def bindings(self, args: Args) -> dict[str, Value]:
        """The values of the parameters and answers that the change determines."""
        return {name: args[i] for name, i in self._occurrence.bound}

    def lean(self, row: ConditionRow, witness: Args) -> None:
        """Keep the witness where a change of its facts finds it."""
        self._relying.setdefault(self._relied_on((*row.key, *witness)), {})[row, witness] = None

    def let_go(self, row: ConditionRow, witness: Args) -> None:
        """Forget the witness."""
        values = self._relied_on((*row.key, *witness))
        leaning = self._relying.get(values)
        if leaning is not None:  # two occurrences may rely on the same fact
            leaning.pop((row, witness), None)
            if not leaning:
                del self._relying[values]

    def open(self, row: ConditionRow) -> None:
        """Keep the row where a change that gives it a witness finds it."""
        self._open.setdefault(self._known(row.key), {}).setdefault(self, {})[row] = None

    def close(self, row: ConditionRow) -> None:
        """Forget the open row."""
        values = self._known(row.key)
        rows = self._open[values][self]
        del rows[row]
        if not rows:
            del self._open[values][self]
            if not self._open[values]:
                del self._open[values]

    def admits(self, args: Args) -> bool:
        """Whether a change with these arguments fits, and the part of the condition that it alone settles is true.

        Most changes end here. A part that cannot be computed is left to the evaluation of the whole condition.
        """
        equal = self._occurrence.equal
        if equal and any(args[i] != args[j] for i, j in equal):
            return False
        if self._settled is None:
            return True
        try:
            return self._settled(self.relation.world, self.bindings(args))
        except InputError:
            return True

    @cached_property
    def _settled(self) -> Test | None:
        """The part of the condition that a change settles alone, if there is one."""
        names = {position: name for name, position in self._occurrence.bound}
        said = Atom(self._occurrence.name, tuple(Variable(names[i]) for i in sorted(names)))  # true by the change
        known = frozenset(names.values())
        rest = (part for part in conjuncts(self.relation.shape.body) if part != said)
        parts = tuple(part for part in rest if free_variables(part) <= known)
        return compile_test(And(parts), self.relation.world.schema) if parts else None

    @cached_property
    def search(self) -> Search:
        """Completes what the change and the row's parameters say to witnesses."""
        bound = frozenset(self.relation.shape.params).union(name for name, _ in self._occurrence.bound)
        return compile_query(self.relation.shape.body, self.relation.world.schema, bound)

    @cached_property
    def join(self) -> Search:
        """Completes what the change says to open rows with witnesses: to be run on a `RowsWorld`."""
        shape, schema = self.relation.shape, self.relation.world.schema
        row = Atom(ROWS, tuple(map(Variable, shape.params)))
        bound = frozenset(name for name, _ in self._occurrence.bound)
        return compile_query(And((row, shape.body)), schema_with_rows(schema, shape.params), bound)


class Join:
    """A shape with its rows.

    Args:
        shape: the conditions without their values.
        world: their world; a change is made there before the join receives it.
        readers: finds the index of the name that an occurrence reads.
        changed: receives the rows with other witnesses than before.
    """

    def __init__(
        self,
        shape: Shape,
        world: WorldState,
        readers: Callable[[Occurrence], ConditionIndex],
        changed: dict[ConditionRow, None],
    ) -> None:
        schema = world.schema
        self.shape = shape
        self.rows: dict[Args, ConditionRow] = {}
        self.world = world
        self._triggers = tuple(DeltaJoin(o, self, readers(o)) for o in occurrences(shape.body, schema))
        self._test = compile_test(shape.body, schema)
        self._search = compile_query(shape.body, schema, frozenset(shape.params))
        self._joins = not all(t.covers for t in self._triggers)
        self._open = FactIndex()
        self._rows_world = RowsWorld(world, self._open)
        self._changed = changed

    def row(self, key: Args) -> ConditionRow:
        """The row for these values, evaluated when it is new."""
        row = self.rows.get(key)
        if row is None:
            row = self.rows[key] = ConditionRow(self, key)
            self.renew(row)
        return row

    def want_all(self, row: ConditionRow) -> None:
        """Keep all witnesses of the row from now on."""
        if not row.wants_all:
            row.wants_all = True
            self.renew(row)

    def drop(self, row: ConditionRow) -> None:
        """Forget the row."""
        for witness in tuple(row.witnesses):
            self._remove(row, witness)
        self._mend(row)
        self._list(row, is_open=False)
        del self.rows[row.key]

    def loses(self, row: ConditionRow, witness: Args) -> bool:
        """Drop the witness if it no longer holds; return whether the row needs a search then."""
        try:
            if self._test(self.world, {**row.bindings, **dict(zip(self.shape.answers, witness, strict=True))}):
                return False
        except InputError as error:
            self._fail(row, error)
        self._remove(row, witness)
        return not row.witnesses and not row.wants_all

    def make(self, trigger: DeltaJoin, args: Args, rows: dict[ConditionRow, None]) -> None:
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

    def renew(self, row: ConditionRow) -> None:
        """Evaluate the row again."""
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

    def _complete(self, row: ConditionRow, trigger: DeltaJoin, bindings: Bindings) -> None:
        """Find the witnesses of the row that the change makes."""
        together = {**row.bindings, **bindings}
        if not trigger.leaves_open:
            if self._test(self.world, together):
                self._add(row, self._witness(together))
            return
        for found in self._few(row, trigger.search(self.world, together)):
            self._add(row, self._witness(found))

    def _few(self, row: ConditionRow, found: Iterator[Bindings]) -> list[Bindings]:
        if row.wants_all:
            return list(found)
        first = next(found, None)
        return [] if first is None else [first]

    def _witness(self, bindings: Bindings) -> Args:
        return tuple([bindings[name] for name in self.shape.answers])

    def _add(self, row: ConditionRow, witness: Args) -> None:
        if witness in row.witnesses or not row.is_open or row.error is not None:
            return
        row.witnesses[witness] = None
        for trigger in self._triggers:
            trigger.lean(row, witness)
        self._has_changed(row)

    def _remove(self, row: ConditionRow, witness: Args) -> None:
        del row.witnesses[witness]
        for trigger in self._triggers:
            trigger.let_go(row, witness)
        self._has_changed(row)

    def _has_changed(self, row: ConditionRow) -> None:
        self._changed[row] = None
        self._list(row, is_open=row.is_open)

    def _list(self, row: ConditionRow, *, is_open: bool) -> None:
        """Put an open row into index and relation, where changes find it; take a closed row out."""
        if row.is_listed is is_open:
            return
        row.is_listed = is_open
        for trigger in self._triggers:
            if is_open:
                trigger.open(row)
            else:
                trigger.close(row)
        if self._joins and is_open:
            self._open.add(Fact(ROWS, row.key))
        elif self._joins:
            self._open.discard(Fact(ROWS, row.key))

    def _fail(self, row: ConditionRow, error: InputError) -> None:
        row.error = error
        for trigger in self._triggers:
            trigger.readers.failing[row] = None

    def _mend(self, row: ConditionRow) -> None:
        if row.error is not None:
            row.error = None
            for trigger in self._triggers:
                trigger.readers.failing.pop(row, None)


ConditionIndex = AlphaIndex[ConditionRow, DeltaJoin]
"""The rows of all joins that read one name."""
