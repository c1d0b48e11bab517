"""Join of the installed conditions of one shape, updated by each change (Rete, Forgy 1982)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property, lru_cache
from operator import itemgetter

from knowledge_base.conditions.shape import Args, Occurrence, Shape, occurrences
from knowledge_base.errors import InputError
from knowledge_base.facts import Fact, Value
from knowledge_base.language.checking.vocabulary import Signature
from knowledge_base.language.evaluation.compiler import compile_query, compile_test
from knowledge_base.language.evaluation.lookups import Search, conjuncts
from knowledge_base.language.evaluation.terms import Bindings, Test
from knowledge_base.language.syntax.expression import And, Atom, TypedVariable, Variable, free_variables
from knowledge_base.world.fact_index import FactIndex
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

ROWS = "installed rows"
"""Name of the predicate for open rows.

The name contains a blank, so that no text can declare or contain the predicate.
"""

Positions = tuple[int, ...]
Picked = object
"""The values at some positions: one value itself, several values as a tuple."""
Picker = Callable[[Args], Picked]


class ConditionRow:
    """All installed conditions of one shape with equal values.

    Attributes:
        relation: the join of the shape.
        key: the values of the shape's parameters.
        bindings: the values of the shape's parameters, by name.
        witnesses: values of the shape's answers that make the condition true; only one of them without `wants_all`.
        wants_all: whether the row keeps all witnesses, because each change of their set can fire.
        is_listed: whether the alpha index contains the row as an open row.
        error: the error that prevents the evaluation of the row, or `None`.
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
        """Whether the row has a witness."""
        return bool(self.witnesses)

    @property
    def is_open(self) -> bool:
        """Whether another witness would change the row."""
        return self.wants_all or not self.witnesses

    @property
    def witness(self) -> Args | None:
        """Values of the shape's answers that make the condition true; `None` when it is false."""
        return next(iter(self.witnesses), None)


class AlphaIndex:
    """The rows that read one predicate, function or type, by polarity and by their values at some positions.

    Attributes:
        failing: rows whose evaluation raised an error; every change evaluates them again.
    """

    def __init__(self) -> None:
        self.failing: dict[ConditionRow, None] = {}
        self._relying: dict[tuple[int, Positions], tuple[Picker, _Relying]] = {}
        self._open: dict[tuple[int, Positions], tuple[Picker, _Open]] = {}

    def __bool__(self) -> bool:
        """Return whether a change can affect any row."""
        return bool(self.failing) or any(found for _, found in (*self._relying.values(), *self._open.values()))

    def relying_at(self, polarity: int, positions: Positions) -> _Relying:
        """Return the witnesses that depend on facts; the keys are the facts' values at the given positions."""
        return self._relying.setdefault((polarity, positions), (_picker(positions), {}))[1]

    def open_at(self, polarity: int, positions: Positions) -> _Open:
        """Return the index of the open rows with parameters at these positions, by the values of the parameters."""
        return self._open.setdefault((polarity, positions), (_picker(positions), {}))[1]

    def broken(self, args: Args, sign: int) -> list[tuple[ConditionRow, Args]]:
        """Return the rows with the witnesses that a change may make invalid."""
        found: list[tuple[ConditionRow, Args]] = []
        for (polarity, _), (pick, relying) in self._relying.items():
            if relying and sign * polarity <= 0:
                found += relying.get(pick(args), ())
        return found

    def rows(self) -> dict[ConditionRow, None]:
        """Return all rows that read the predicate, function or type."""
        found = self.failing.copy()
        for _, relying in self._relying.values():
            found.update((row, None) for several in relying.values() for row, _ in several)
        for _, listed in self._open.values():
            for by_trigger in listed.values():
                for rows in by_trigger.values():
                    found.update(rows)
        return found

    def made(self, args: Args, sign: int) -> list[tuple[DeltaJoin, dict[ConditionRow, None]]]:
        """Return the open rows for which a change may create a witness, by delta join."""
        found: list[tuple[DeltaJoin, dict[ConditionRow, None]]] = []
        for (polarity, _), (pick, rows) in self._open.items():
            if rows and sign * polarity >= 0:
                found += rows.get(pick(args), {}).items()
        return found


class DeltaJoin:
    """An occurrence in a shape; adds the rows and witnesses of the shape to the alpha index.

    Attributes:
        relation: the join of the shape.
        readers: the index of the predicate, function or type that the occurrence reads.
        covers: whether a change determines all parameters of the shape.
        finds: whether a change determines some answers of the shape.
        leaves_open: whether a change leaves some answers undetermined.
    """

    def __init__(self, occurrence: Occurrence, relation: Join, readers: AlphaIndex) -> None:
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
        self._relied_on = _picker(tuple(column for _, column in everything))
        self._open = readers.open_at(occurrence.polarity, tuple(position for position, _ in params))
        self._known = _picker(tuple(column for _, column in params))

    def bindings(self, args: Args) -> dict[str, Value] | None:
        """Return the parameters and answers that a change determines.

        Return `None` if the arguments of the change do not match the occurrence.
        """
        found: dict[str, Value] = {}
        for one, other in self._occurrence.equal:
            if args[one] != args[other]:
                return None
        for name, position in self._occurrence.bound:
            found[name] = args[position]
        return found

    def settles(self, bindings: Bindings) -> bool:
        """Return whether the part of the condition that a change alone determines is false, as for most changes."""
        if self._settled is None:
            return False
        try:
            return not self._settled(self.relation.world, bindings)
        except InputError:  # the evaluation of the whole condition decides
            return False

    def lean(self, row: ConditionRow, witness: Args) -> None:
        """Add the witness to the index, by the facts that it depends on."""
        self._relying.setdefault(self._relied_on((*row.key, *witness)), {})[row, witness] = None

    def let_go(self, row: ConditionRow, witness: Args) -> None:
        """Remove the witness from the index."""
        values = self._relied_on((*row.key, *witness))
        leaning = self._relying.get(values)
        if leaning is not None:  # two occurrences may depend on the same fact
            leaning.pop((row, witness), None)
            if not leaning:
                del self._relying[values]

    def open(self, row: ConditionRow) -> None:
        """Add the open row to the index, by the changes that can create a witness for the row."""
        self._open.setdefault(self._known(row.key), {}).setdefault(self, {})[row] = None

    def close(self, row: ConditionRow) -> None:
        """Remove the row from the index of open rows."""
        values = self._known(row.key)
        rows = self._open[values][self]
        del rows[row]
        if not rows:
            del self._open[values][self]
            if not self._open[values]:
                del self._open[values]

    @cached_property
    def _settled(self) -> Test | None:
        """The test of the conjuncts that a change alone determines; `None` without such conjuncts."""
        names = {position: name for name, position in self._occurrence.bound}
        changed = Atom(self._occurrence.name, tuple(Variable(names[i]) for i in sorted(names)))  # true after the change
        known = frozenset(names.values())
        rest = (part for part in conjuncts(self.relation.shape.body) if part != changed)
        parts = tuple(part for part in rest if free_variables(part) <= known)
        return compile_test(And(parts), self.relation.world.schema) if parts else None

    @cached_property
    def search(self) -> Search:
        """The search that completes the values of a change and of a row to witnesses."""
        bound = frozenset(self.relation.shape.params).union(name for name, _ in self._occurrence.bound)
        return compile_query(self.relation.shape.body, self.relation.world.schema, bound)

    @cached_property
    def join(self) -> Search:
        """The search that completes the values of a change to open rows with witnesses.

        The search reads the world with the open rows as facts.
        """
        shape, schema = self.relation.shape, self.relation.world.schema
        row = Atom(ROWS, tuple(map(Variable, shape.params)))
        bound = frozenset(name for name, _ in self._occurrence.bound)
        return compile_query(And((row, shape.body)), _schema_with_rows(schema, shape.params), bound)


class Join:
    """A shape with its rows; the rows are updated after each change.

    Args:
        shape: the conditions without their values.
        world: the world of the conditions; each change is applied to the world before the join processes the change.
        readers: returns the alpha index for an occurrence.
        changed: receives the rows whose witnesses have changed.
    """

    def __init__(
        self,
        shape: Shape,
        world: WorldState,
        readers: Callable[[Occurrence], AlphaIndex],
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
        self._world_with_rows = Overlay(world, self._open)
        self._changed = changed

    def row(self, key: Args) -> ConditionRow:
        """Return the row for these values; a new row is evaluated immediately."""
        row = self.rows.get(key)
        if row is None:
            row = self.rows[key] = ConditionRow(self, key)
            self.renew(row)
        return row

    def want_all(self, row: ConditionRow) -> None:
        """Keep all witnesses of the row, not only one, from now on."""
        if not row.wants_all:
            row.wants_all = True
            self.renew(row)

    def drop(self, row: ConditionRow) -> None:
        """Remove the row."""
        for witness in tuple(row.witnesses):
            self._remove(row, witness)
        self._repair(row)
        self._list(row, is_open=False)
        del self.rows[row.key]

    def close(self) -> None:
        """Release the delta joins, which refer to this join: a join without rows needs no garbage collection."""
        self._triggers = ()

    def loses(self, row: ConditionRow, witness: Args) -> bool:
        """Remove the witness if it is no longer valid; return whether the row then needs a new search."""
        try:
            if self._test(self.world, {**row.bindings, **dict(zip(self.shape.answers, witness, strict=True))}):
                return False
        except InputError as error:
            self._fail(row, error)
        self._remove(row, witness)
        return not row.witnesses and not row.wants_all

    def make(self, trigger: DeltaJoin, args: Args, rows: dict[ConditionRow, None]) -> None:
        """Add the witnesses that a change creates, for the open rows with matching parameters."""
        bindings = trigger.bindings(args)
        is_simple = len(rows) == 1 and not trigger.leaves_open
        if bindings is None or (not is_simple and trigger.settles(bindings)):
            return
        try:
            if len(rows) == 1 or not trigger.finds:
                for row in tuple(rows):
                    self._complete(row, trigger, bindings)
            else:
                for found in list(trigger.join(self._world_with_rows, bindings)):
                    self._add(self.rows[tuple([found[name] for name in self.shape.params])], self._witness(found))
        except InputError:  # a row cannot be evaluated; find it by evaluating each
            for row in tuple(rows):
                self.renew(row)

    def renew(self, row: ConditionRow) -> None:
        """Evaluate the row again."""
        try:
            found = dict.fromkeys(self._witness(b) for b in self._few(row, self._search(self.world, row.bindings)))
            self._repair(row)
        except InputError as error:
            found = {}
            self._fail(row, error)
        for witness in [w for w in row.witnesses if w not in found]:
            self._remove(row, witness)
        for witness in found:
            self._add(row, witness)
        self._list(row, is_open=row.is_open)

    def _complete(self, row: ConditionRow, trigger: DeltaJoin, bindings: Bindings) -> None:
        """Add the witnesses that the change creates for the row."""
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
        return tuple(map(bindings.__getitem__, self.shape.answers))

    def _add(self, row: ConditionRow, witness: Args) -> None:
        if witness in row.witnesses or not row.is_open or row.error is not None:
            return
        row.witnesses[witness] = None
        for trigger in self._triggers:
            trigger.lean(row, witness)
        self._changed[row] = None
        self._list(row, is_open=row.wants_all)

    def _remove(self, row: ConditionRow, witness: Args) -> None:
        del row.witnesses[witness]
        for trigger in self._triggers:
            trigger.let_go(row, witness)
        self._changed[row] = None
        self._list(row, is_open=row.is_open)

    def _list(self, row: ConditionRow, *, is_open: bool) -> None:
        """Add an open row to the index of open rows, or remove a closed row from it."""
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

    def _repair(self, row: ConditionRow) -> None:
        if row.error is not None:
            row.error = None
            for trigger in self._triggers:
                trigger.readers.failing.pop(row, None)


_Relying = dict[Picked, dict[tuple[ConditionRow, Args], None]]
"""Rows and witnesses, by the arguments of the facts that the witnesses depend on."""
_Open = dict[Picked, dict[DeltaJoin, dict[ConditionRow, None]]]
"""Open rows by the values of their parameters, and by the delta join that finds their witnesses."""


def _picker(positions: Positions) -> Picker:
    """Return a function that returns the values at these positions."""
    return itemgetter(*positions) if positions else itemgetter(slice(0))


@lru_cache(maxsize=64)
def _schema_with_rows(schema: Schema, params: tuple[str, ...]) -> Schema:
    """Return `schema` with the open rows declared.

    Results are cached, as most shapes have parameters with equal names.
    """
    rows = Signature(ROWS, tuple(map(TypedVariable, params)))
    return replace(schema, predicates={**schema.predicates, ROWS: rows})
