"""One place where a change reaches the conditions of a shape: whom it may break and how to look whom it makes true."""

from __future__ import annotations

from functools import cached_property

from knowledge_base.conditions.dependencies import Occurrence
from knowledge_base.conditions.readers import Readers, picker
from knowledge_base.conditions.rows import ROWS, Row, schema_with_rows
from knowledge_base.conditions.shape import Args, Shape
from knowledge_base.facts import Value
from knowledge_base.language.compiler import compile_query, compile_test
from knowledge_base.language.expression import And, Atom, Variable, free_variables
from knowledge_base.language.joins import conjuncts
from knowledge_base.language.lookups import Search
from knowledge_base.language.terms import Test
from knowledge_base.schema import Schema


class Trigger:
    """An occurrence in a shape; it puts the shape's rows and witnesses where a change finds them.

    Attributes:
        readers: all who read what it is about.
        covers: whether a change determines all parameters.
        finds: whether a change determines some of the answers.
        leaves_open: whether it leaves some of them open.
    """

    def __init__(self, occurrence: Occurrence, shape: Shape, schema: Schema, readers: Readers) -> None:
        positions = dict(occurrence.bound)
        columns = {name: i for i, name in enumerate((*shape.params, *shape.answers))}
        params = sorted((positions[name], columns[name]) for name in shape.params if name in positions)
        everything = sorted((position, columns[name]) for name, position in positions.items())
        self.readers = readers
        self.covers = positions.keys() >= set(shape.params)
        self.finds = any(name in positions for name in shape.answers)
        self.leaves_open = not all(name in positions for name in shape.answers)
        self._occurrence, self._shape, self._schema = occurrence, shape, schema
        self._relying = readers.relying_at(occurrence.polarity, tuple(position for position, _ in everything))
        self._relied_on = picker(tuple(column for _, column in everything))
        self._open = readers.open_at(occurrence.polarity, tuple(position for position, _ in params))
        self._known = picker(tuple(column for _, column in params))

    def fits(self, args: Args) -> bool:
        """Whether the arguments that must be equal are."""
        equal = self._occurrence.equal
        return not equal or all(args[i] == args[j] for i, j in equal)

    def bindings(self, args: Args) -> dict[str, Value]:
        """The values of the parameters and answers that the change determines."""
        return {name: args[i] for name, i in self._occurrence.bound}

    def lean(self, row: Row, witness: Args) -> None:
        """The witness is kept and has to be looked at when what it relies on changes."""
        self._relying.setdefault(self._relied_on((*row.key, *witness)), {})[row, witness] = None

    def let_go(self, row: Row, witness: Args) -> None:
        """The witness is not kept any more."""
        values = self._relied_on((*row.key, *witness))
        leaning = self._relying.get(values)
        if leaning is not None:  # two occurrences may rely on the same fact
            leaning.pop((row, witness), None)
            if not leaning:
                del self._relying[values]

    def open(self, row: Row) -> None:
        """Another witness of the row would make a difference."""
        self._open.setdefault(self._known(row.key), {}).setdefault(self, {})[row] = None

    def close(self, row: Row) -> None:
        """It would make none any more."""
        values = self._known(row.key)
        rows = self._open[values][self]
        del rows[row]
        if not rows:
            del self._open[values][self]
            if not self._open[values]:
                del self._open[values]

    @cached_property
    def may(self) -> Test:
        """Whether what the change alone settles of the condition is true: most changes end here."""
        places = sorted((position, name) for name, position in self._occurrence.bound)
        said = Atom(self._occurrence.name, tuple(Variable(name) for _, name in places))  # it is true by the change
        settled = {name for _, name in places}
        parts = [part for part in conjuncts(self._shape.body) if part != said and free_variables(part) <= settled]
        return compile_test(And(tuple(parts)), self._schema)

    @cached_property
    def search(self) -> Search:
        """Completes what the change and the row's parameters say to witnesses."""
        bound = frozenset(self._shape.params).union(name for name, _ in self._occurrence.bound)
        return compile_query(self._shape.body, self._schema, bound)

    @cached_property
    def join(self) -> Search:
        """Completes what the change says to open rows with witnesses: to be run on a `RowsWorld`."""
        row = Atom(ROWS, tuple(map(Variable, self._shape.params)))
        bound = frozenset(name for name, _ in self._occurrence.bound)
        return compile_query(And((row, self._shape.body)), schema_with_rows(self._schema, self._shape.params), bound)
