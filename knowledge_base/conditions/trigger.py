"""One place where a change reaches the conditions of a shape: whom it may break and how to look whom it makes true."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

from knowledge_base.conditions.dependencies import Occurrence
from knowledge_base.conditions.readers import Readers, picker
from knowledge_base.conditions.rows import ROWS, Row, schema_with_rows
from knowledge_base.conditions.shape import Args
from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.compiler import compile_query, compile_test
from knowledge_base.language.expression import And, Atom, Expression, Variable, free_variables
from knowledge_base.language.joins import conjuncts
from knowledge_base.language.lookups import Search
from knowledge_base.language.source import test_source

if TYPE_CHECKING:
    from knowledge_base.conditions.relation import Relation


_source = lru_cache(maxsize=1024)(test_source)
"""Written once for conditions that are installed again and again."""


class Trigger:
    """An occurrence in a shape; it puts the shape's rows and witnesses where a change finds them.

    Attributes:
        relation: the shape with its rows.
        readers: all who read what it is about.
        covers: whether a change determines all parameters.
        finds: whether a change determines some of the answers.
        leaves_open: whether it leaves some of them open.
    """

    def __init__(self, occurrence: Occurrence, relation: Relation, readers: Readers) -> None:
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
    def admits(self) -> Callable[..., bool]:
        """Whether a change with these arguments fits, and what it alone settles of the condition is true.

        Most changes end here. What cannot be computed is left to who looks at the whole condition.
        """
        names = {position: name for name, position in self._occurrence.bound}
        said = Atom(self._occurrence.name, tuple(Variable(names[i]) for i in sorted(names)))  # true by the change
        settled = set(names.values())
        rest = (part for part in conjuncts(self.relation.shape.body) if part != said)
        parts = [part for part in rest if free_variables(part) <= settled]
        test = self._settling(And(tuple(parts)), names)
        equal = self._occurrence.equal
        return test if not equal else lambda *args: all(args[i] == args[j] for i, j in equal) and test(*args)

    def _settling(self, e: Expression, names: Mapping[int, str]) -> Callable[..., bool]:
        """`e` as a function of a change's arguments; `names` are its variables by the positions of these."""
        world, schema = self.relation.world, self.relation.world.schema
        arguments = tuple([names.get(i, f"argument {i}") for i in range(max(names, default=-1) + 1)])
        source = _source(e, schema, arguments)
        if source is not None:
            return source.bound(world)
        holds = compile_test(e, schema)

        def test(*args: Value) -> bool:
            try:
                return holds(world, self.bindings(args))
            except InputError:
                return True

        return test

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
