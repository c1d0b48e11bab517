"""One place where a change reaches the conditions of a shape: whom it may break and how to look whom it makes true."""

from __future__ import annotations

from functools import cached_property

from knowledge_base.conditions.dependencies import Occurrence
from knowledge_base.conditions.rows import ROWS, Row, schema_with_rows
from knowledge_base.conditions.shape import Args, Shape
from knowledge_base.facts import Value
from knowledge_base.language.compiler import compile_query
from knowledge_base.language.expression import And, Atom, Variable
from knowledge_base.language.lookups import Search
from knowledge_base.schema import Schema

_NOBODY: dict[tuple[Row, Args], None] = {}


class Trigger:
    """An occurrence in a shape, with an index of the witnesses by the arguments they rely on there.

    Attributes:
        occurrence: what it is about.
        polarity: that of the occurrence.
        covers: whether a change determines all parameters, so that the row is found by its key.
        finds: whether a change determines some of the answers.
        leaves_open: whether it leaves some of them open.
    """

    def __init__(self, occurrence: Occurrence, shape: Shape, schema: Schema) -> None:
        positions = dict(occurrence.bound)
        columns = {name: i for i, name in enumerate((*shape.params, *shape.answers))}
        self.occurrence = occurrence
        self.polarity = occurrence.polarity
        self.covers = positions.keys() >= set(shape.params)
        self.finds = any(name in positions for name in shape.answers)
        self.leaves_open = not all(name in positions for name in shape.answers)
        self._shape, self._schema = shape, schema
        self._positions = tuple(positions.values())
        self._columns = tuple(columns[name] for name in positions)
        self._key = tuple(positions[name] for name in shape.params) if self.covers else ()
        self._row_pattern = tuple(positions.get(name) for name in shape.params)
        self._equal = occurrence.equal
        self._relying: dict[Args, dict[tuple[Row, Args], None]] = {}

    def fits(self, args: Args) -> bool:
        """Whether the arguments that must be equal are."""
        return not self._equal or all(args[i] == args[j] for i, j in self._equal)

    def key(self, args: Args) -> Args:
        """The values of all parameters, if the trigger `covers` them."""
        return tuple([args[i] for i in self._key])

    def row_pattern(self, args: Args) -> tuple[Value | None, ...]:
        """The values of the parameters, as far as the change determines them."""
        return tuple([None if i is None else args[i] for i in self._row_pattern])

    def bindings(self, args: Args) -> dict[str, Value]:
        """The values of the parameters and answers that the change determines."""
        return {name: args[i] for name, i in self.occurrence.bound}

    def relying(self, args: Args) -> dict[tuple[Row, Args], None]:
        """The rows with the witnesses that a change of these arguments may break, as an ordered set."""
        return self._relying.get(tuple([args[i] for i in self._positions]), _NOBODY)

    def lean(self, row: Row, witness: Args) -> None:
        """The witness is kept and has to be looked at when what it relies on changes."""
        self._relying.setdefault(self._instance(row, witness), {})[row, witness] = None

    def let_go(self, row: Row, witness: Args) -> None:
        """The witness is not kept any more."""
        instance = self._instance(row, witness)
        leaning = self._relying[instance]
        del leaning[row, witness]
        if not leaning:
            del self._relying[instance]

    @cached_property
    def search(self) -> Search:
        """Completes what the change and the row's parameters say to witnesses."""
        bound = frozenset(self._shape.params).union(name for name, _ in self.occurrence.bound)
        return compile_query(self._shape.body, self._schema, bound)

    @cached_property
    def join(self) -> Search:
        """Completes what the change says to open rows with witnesses: to be run on a `RowsWorld`."""
        row = Atom(ROWS, tuple(map(Variable, self._shape.params)))
        bound = frozenset(name for name, _ in self.occurrence.bound)
        return compile_query(And((row, self._shape.body)), schema_with_rows(self._schema, self._shape.params), bound)

    def _instance(self, row: Row, witness: Args) -> Args:
        values = (*row.key, *witness)
        return tuple([values[i] for i in self._columns])
