"""One state of the world in memory: things with their types, facts, and what functions are worth."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from knowledge_base.facts import Content, Delta, Fact, Value
from knowledge_base.world.index import FactIndex
from knowledge_base.world.schema import Schema


class WorldState:
    """A `World` of its own. It begins with the schema's constants and nothing known about them.

    Functions may be fed by sources (`sources`): their latest values are read like any other, but they are no
    part of `values`, of copies, and of what is committed.
    """

    def __init__(self, schema: Schema) -> None:
        self._schema = schema
        self._facts = FactIndex()
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
        """The state with exactly these things (constants too), facts and values, which fit the schema.

        Their order is the order of insertion.
        """
        state = cls(schema)
        state._types = {}
        state._members = {t: {} for t in schema.types}
        for name, type_name in nodes.items():
            state._add_node(name, type_name)
        for fact in facts:
            state._facts.add(fact)
        state._values = dict(values)
        return state

    def __len__(self) -> int:
        """How many things, facts and values it holds."""
        return len(self._types) + len(self._facts) + len(self._values)

    @property
    def schema(self) -> Schema:
        """What may be said about it."""
        return self._schema

    @property
    def nodes(self) -> Mapping[str, str]:
        """All things with their types, in order of insertion."""
        return self._types

    @property
    def facts(self) -> FactIndex:
        """All facts."""
        return self._facts

    @property
    def values(self) -> Mapping[Fact, Content]:
        """What functions were set to."""
        return self._values

    @property
    def references(self) -> Mapping[Fact, str]:
        """The fluents that are fed by sources, and where what they are worth comes from."""
        return self._references

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true."""
        return self._facts.holds(predicate, args)

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[tuple[Value, ...]]:
        """The arguments of all facts that agree with `pattern`, found while iterating; `None` is open."""
        return self._facts.match(predicate, pattern)

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """At most how many facts agree with `pattern`."""
        return self._facts.estimate(predicate, pattern)

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """What the function is worth; until it is set, what `content.UNSET` says.

        Raises:
            UnknownNameError: there is no such function.
        """
        fluent = Fact(function, args)
        found = self._latest.get(fluent) if self._latest else None
        if found is None:
            found = self._values.get(fluent)
        return self._schema.unset(function) if found is None else found

    def reference(self, function: str, args: tuple[Value, ...]) -> str | None:
        """Where what the function is worth comes from, if a source feeds it."""
        return self._references.get(Fact(function, args)) if self._references else None

    def values_about(self, things: Collection[str]) -> list[Fact]:
        """The fluents with one of these things in them that were set or fed."""
        fluents = {**self._values, **self._latest} if self._latest else self._values
        return [f for f in fluents if any(arg in things for arg in f.args)]

    def bind(self, fluent: Fact, reference: str) -> None:
        """From now on the fluent is fed; until the first time it reads as before."""
        self._references[fluent] = reference

    def feed(self, fluent: Fact, content: Content) -> None:
        """A bound fluent is worth this now."""
        self._latest[fluent] = content

    def unbind(self, fluent: Fact) -> None:
        """The fluent is not fed any more and reads as if it had never been."""
        del self._references[fluent]
        self._latest.pop(fluent, None)

    def objects(self, type_name: str) -> list[str]:
        """The things of that type or a subtype.

        Raises:
            UnknownNameError: there is no such type.
        """
        if type_name not in self._members:
            self._schema.require_type(type_name)
        return list(self._members[type_name])

    def type_of(self, name: str) -> str | None:
        """The thing's type; `None` if there is no such thing."""
        return self._types.get(name)

    def commit(self, effective: Delta) -> None:
        """Make a change that was checked and worked out on this very state (`Overlay.delta`)."""
        for name in effective.removed_nodes:
            self._remove_node(name)
        for name, type_name in effective.nodes.items():
            self._add_node(name, type_name)
        for fact in effective.removed:
            self._facts.discard(fact)
        for fact in effective.added:
            self._facts.add(fact)
        self._values.update(effective.values)

    def copy(self, *, fed: bool = False) -> WorldState:
        """An independent state that says the same, without sources; with `fed` their latest values are set in it."""
        twin = WorldState(self._schema)
        twin._facts = self._facts.copy()
        twin._values = {**self._values, **self._latest} if fed else self._values.copy()
        twin._types = self._types.copy()
        twin._members = {t: members.copy() for t, members in self._members.items()}
        return twin

    def _add_node(self, name: str, type_name: str) -> None:
        self._types[name] = type_name
        for ancestor in self._schema.ancestors(type_name):
            self._members[ancestor][name] = None

    def _remove_node(self, name: str) -> None:
        """Its facts are among the change's removed ones; its values are found here."""
        for ancestor in self._schema.ancestors(self._types.pop(name)):
            del self._members[ancestor][name]
        self._values = {f: v for f, v in self._values.items() if name not in f.args}
