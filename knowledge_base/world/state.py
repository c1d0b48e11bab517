"""State of a world in memory: objects with their types, indexed facts, and values of functions."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, cast

from knowledge_base.facts import Content, Delta, Fact, Value
from knowledge_base.world.fact_index import Args, FactIndex
from knowledge_base.world.live_rows import LiveRows, Rows
from knowledge_base.world.schema import Schema

if TYPE_CHECKING:  # loads scipy
    from knowledge_base.transforms.poses import Pair, Poses


class WorldState:
    """A `World` in memory; a new state contains only the constants of the schema.

    A function may be bound to a source (`sources`); `value` then returns the latest value of the source. `values`,
    copies and commits do not contain these latest values.

    Attributes:
        schema: the declarations of the world.
        facts: all facts; `holds`, `match` and `estimate` are its methods, unless relations are provided.
        live: the rows of relations, which copies do not have.
        poses: the functions that transform trees answer, by name; only copies with the latest values have them.
    """

    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self.live = LiveRows()
        self.poses: dict[str, Poses] = {}
        self._index(FactIndex())
        self._values: dict[Fact, Content] = {}
        self._references: dict[Fact, str] = {}
        self._latest: dict[Fact, Content] = {}
        self._types: dict[str, str] = {}
        self._members: dict[str, dict[str, None]] = {t: {} for t in schema.types}
        for name, type_name in schema.constants.items():
            self._add_node(name, type_name)

    @classmethod
    def of(
        cls, schema: Schema, nodes: Mapping[str, str], facts: Iterable[Fact], values: Mapping[Fact, Content]
    ) -> WorldState:
        """Return the state with exactly these objects, facts and values, which must match the schema.

        `nodes` must contain the constants too.

        The order of the arguments is the order of insertion.
        """
        state = cls(schema)
        state._types = {}
        state._members = {t: {} for t in schema.types}
        for name, type_name in nodes.items():
            state._add_node(name, type_name)
        for fact in facts:
            state.facts.add(fact)
        state._values = dict(values)
        return state

    def __len__(self) -> int:
        """Return the number of objects, facts and values."""
        return len(self._types) + len(self.facts) + len(self._values)

    @property
    def nodes(self) -> Mapping[str, str]:
        """All objects with their types, in order of insertion."""
        return self._types

    @property
    def values(self) -> Mapping[Fact, Content]:
        """Values that changes have set, by function and arguments."""
        return self._values

    @property
    def references(self) -> Mapping[Fact, str]:
        """The fluents with a bound source, each with the reference of the source."""
        return self._references

    def value(self, function: str, args: Args) -> Content:
        """Return the value of the function; before the first assignment the value in `UNSET` for its type.

        Raises:
            UnknownNameError: the function is not declared.
        """
        if self.poses and function in self.poses:
            return self.poses[function].value(cast("Pair", args)) if self._types.keys() >= {*args} else ()
        fluent = Fact(function, args)
        found = self._latest.get(fluent) if self._latest else None
        if found is None:
            found = self._values.get(fluent)
        return self.schema.unset(function) if found is None else found

    def reference(self, function: str, args: Args) -> str | None:
        """Return the reference of the source that is bound to the function, or `None`."""
        return self._references.get(Fact(function, args)) if self._references else None

    def publishes(self, function: str) -> bool:
        """Return whether a transform tree answers the function, and receives its new values."""
        return function in self.poses

    def require_publishable(self, values: Mapping[Fact, Content]) -> None:
        """Raise `TransformError` if a transform tree refuses one of these values."""
        for poses in self.poses.values():
            poses.require_publishable(values)

    def values_about(self, things: Collection[str]) -> list[Fact]:
        """Return the fluents with a set or latest value that have one of these objects as an argument."""
        fluents = {**self._values, **self._latest} if self._latest else self._values
        return [f for f in fluents if any(arg in things for arg in f.args)]

    def bind(self, fluent: Fact, reference: str) -> None:
        """Bind a source to the fluent, which keeps its value until the first update."""
        self._references[fluent] = reference

    def feed(self, fluent: Fact, content: Content) -> None:
        """Set the latest value of a bound fluent."""
        self._latest[fluent] = content

    def unbind(self, fluent: Fact) -> None:
        """Remove the source of the fluent and its latest value."""
        del self._references[fluent]
        self._latest.pop(fluent, None)

    def objects(self, type_name: str) -> list[str]:
        """Return the objects of that type and its subtypes.

        Raises:
            UnknownNameError: the type is not declared.
        """
        if type_name not in self._members:
            self.schema.require_type(type_name)
        return list(self._members[type_name])

    def type_of(self, name: str) -> str | None:
        """Return the type of the object; `None` if the object is unknown."""
        return self._types.get(name)

    def commit(self, effective: Delta) -> None:
        """Apply an effective change, i.e. the `delta` of an `Overlay` on this state."""
        for name in effective.removed_nodes:
            self._remove_node(name)
        for name, type_name in effective.nodes.items():
            self._add_node(name, type_name)
        for fact in effective.removed:
            self.facts.discard(fact)
        for fact in effective.added:
            self.facts.add(fact)
        self._values.update(effective.values)

    def copy(self, *, fed: bool = False) -> WorldState:
        """Return an independent equal state without sources; with `fed`, the latest values are set as values."""
        twin = WorldState(self.schema)
        twin._index(self.facts.copy())
        twin._values = {**self._values, **self._latest} if fed else self._values.copy()
        twin.poses = {name: poses.copy() for name, poses in self.poses.items()} if fed else {}
        twin._types = self._types.copy()
        twin._members = {t: members.copy() for t, members in self._members.items()}
        return twin

    def spend(self) -> None:
        """Accept all effects; this world has no bounds."""

    def _index(self, facts: FactIndex) -> None:
        self.facts = facts
        self.holds, self.match, self.estimate = facts.holds, facts.match, facts.estimate

    def provide(self, rows: Mapping[str, Rows]) -> None:
        """Add a provider of rows for relations."""
        self.live.provide(rows)
        self.holds, self.match, self.estimate = self._holds, self._match, self._estimate

    def withdraw(self, rows: Mapping[str, Rows]) -> None:
        """Remove a provider of rows."""
        self.live.withdraw(rows)
        if not self.live:
            self._index(self.facts)

    def _holds(self, predicate: str, args: Args) -> bool:
        return self._rows(predicate).holds(predicate, args)

    def _match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[Args]:
        return self._rows(predicate).match(predicate, pattern)

    def _estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        return self._rows(predicate).estimate(predicate, pattern)

    def _rows(self, predicate: str) -> FactIndex:
        return self.live.of(predicate) if predicate in self.live else self.facts

    def _add_node(self, name: str, type_name: str) -> None:
        self._types[name] = type_name
        for ancestor in self.schema.ancestors(type_name):
            self._members[ancestor][name] = None

    def _remove_node(self, name: str) -> None:
        """Remove the object and its values; the change itself lists the facts to remove."""
        for ancestor in self.schema.ancestors(self._types.pop(name)):
            del self._members[ancestor][name]
        self._values = {f: v for f, v in self._values.items() if name not in f.args}
