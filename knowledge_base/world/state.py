"""A state of the world in memory: things with their types, indexed facts, and values of functions."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import chain

from knowledge_base.facts import Content, Delta, Fact, Value
from knowledge_base.world.schema import Schema

Args = tuple[Value, ...]


class FactIndex:
    """A set of facts in order of insertion, indexed per predicate and argument position.

    Dicts with `None` represent ordered sets. A fact with one argument has no list for it.
    """

    def __init__(self) -> None:
        self._by_predicate: dict[str, dict[Args, Fact]] = {}  # by arguments
        self._by_argument: dict[tuple[str, int, Value], dict[Args, None]] = {}

    def __contains__(self, fact: Fact) -> bool:
        return self.holds(fact.predicate, fact.args)

    def __iter__(self) -> Iterator[Fact]:
        """All facts, predicate by predicate."""
        return chain.from_iterable(map(dict.values, self._by_predicate.values()))

    def __len__(self) -> int:
        return sum(map(len, self._by_predicate.values()))

    def holds(self, predicate: str, args: Args) -> bool:
        """Whether the fact is in the set."""
        known = self._by_predicate.get(predicate)
        return known is not None and args in known

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[Args]:
        """The arguments that agree with `pattern` (`None` is open), in order of insertion.

        The iterator filters the shortest list of facts with one of the bound arguments; the set must not change before
        its end.
        """
        listed = self._listed(predicate, pattern)
        exact = len(pattern) < 3 or pattern.count(None) >= len(pattern) - 1
        return listed if exact else _agreeing(listed, pattern)

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """At most how many facts agree with `pattern`, without looking through them."""
        return len(self._listed(predicate, pattern))

    def _listed(self, predicate: str, pattern: tuple[Value | None, ...]) -> Collection[Args]:
        """The shortest list that has all facts which agree with `pattern`."""
        if len(pattern) == 2:  # queries for the arcs from or to a thing are the most frequent
            start, end = pattern
            if start is None and end is not None:
                return self._by_argument.get((predicate, 1, end), ())
            if end is None and start is not None:
                return self._by_argument.get((predicate, 0, start), ())
        if None not in pattern:
            return (pattern,) if self.holds(predicate, pattern) else ()  # type: ignore[arg-type,return-value]
        shortest: Collection[Args] = self._by_predicate.get(predicate, ())
        for position, value in enumerate(pattern):
            if value is not None:
                listed = self._by_argument.get((predicate, position, value), ())
                if len(listed) < len(shortest):
                    shortest = listed
        return shortest

    def add(self, fact: Fact) -> None:
        """Put the fact at the end, unless it is there."""
        predicate, args = fact.predicate, fact.args
        known = self._by_predicate.get(predicate)
        if known is None:
            known = self._by_predicate[predicate] = {}
        elif args in known:
            return
        known[args] = fact
        if len(args) == 1:
            return
        for position, value in enumerate(args):
            key = predicate, position, value
            listed = self._by_argument.get(key)
            if listed is None:
                self._by_argument[key] = {args: None}
            else:
                listed[args] = None

    def discard(self, fact: Fact) -> None:
        """Take the fact out, if it is there."""
        predicate, args = fact.predicate, fact.args
        known = self._by_predicate.get(predicate)
        if known is None or args not in known:
            return
        del known[args]
        if not known:  # so that the order of predicates depends on the facts alone
            del self._by_predicate[predicate]
        if len(args) == 1:
            return
        for position, value in enumerate(args):
            key = predicate, position, value
            listed = self._by_argument[key]
            del listed[args]
            if not listed:
                del self._by_argument[key]

    def copy(self) -> FactIndex:
        """An independent set with the same facts in the same order."""
        twin = FactIndex()
        twin._by_predicate = {predicate: known.copy() for predicate, known in self._by_predicate.items()}
        twin._by_argument = {key: listed.copy() for key, listed in self._by_argument.items()}
        return twin


def _agreeing(facts: Iterable[Args], pattern: tuple[Value | None, ...]) -> Iterator[Args]:
    bound = [(i, value) for i, value in enumerate(pattern) if value is not None]
    return (args for args in facts if all(args[i] == value for i, value in bound))


class WorldState:
    """A `World` in memory. A new one has the schema's constants, and no facts and values.

    Sources may feed functions (`sources`): questions read their latest values like any other. `values`, copies and
    commits do not have them.

    Attributes:
        schema: its declarations.
        facts: all facts; it also answers `holds`, `match` and `estimate`.
    """

    def __init__(self, schema: Schema) -> None:
        self.schema = schema
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
        """The state with exactly these things (constants too), facts and values, which fit the schema.

        Their order is the order of insertion.
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
        """Number of things, facts and values."""
        return len(self._types) + len(self.facts) + len(self._values)

    @property
    def nodes(self) -> Mapping[str, str]:
        """All things with their types, in order of insertion."""
        return self._types

    @property
    def values(self) -> Mapping[Fact, Content]:
        """Values that functions were set to."""
        return self._values

    @property
    def references(self) -> Mapping[Fact, str]:
        """The fluents that sources feed, each with the reference of its source."""
        return self._references

    def value(self, function: str, args: Args) -> Content:
        """Value of the function; until it is set, the one of its type in `UNSET`.

        Raises:
            UnknownNameError: there is no such function.
        """
        fluent = Fact(function, args)
        found = self._latest.get(fluent) if self._latest else None
        if found is None:
            found = self._values.get(fluent)
        return self.schema.unset(function) if found is None else found

    def reference(self, function: str, args: Args) -> str | None:
        """Reference of the source that feeds the function, if there is one."""
        return self._references.get(Fact(function, args)) if self._references else None

    def values_about(self, things: Collection[str]) -> list[Fact]:
        """The fluents with one of these things in them that were set or fed."""
        fluents = {**self._values, **self._latest} if self._latest else self._values
        return [f for f in fluents if any(arg in things for arg in f.args)]

    def bind(self, fluent: Fact, reference: str) -> None:
        """Let a source feed the fluent, which keeps its value until the first time."""
        self._references[fluent] = reference

    def feed(self, fluent: Fact, content: Content) -> None:
        """Set the latest value of a bound fluent."""
        self._latest[fluent] = content

    def unbind(self, fluent: Fact) -> None:
        """Forget the source of the fluent and its latest value."""
        del self._references[fluent]
        self._latest.pop(fluent, None)

    def objects(self, type_name: str) -> list[str]:
        """The things of that type or a subtype.

        Raises:
            UnknownNameError: there is no such type.
        """
        if type_name not in self._members:
            self.schema.require_type(type_name)
        return list(self._members[type_name])

    def type_of(self, name: str) -> str | None:
        """The thing's type; `None` if there is no such thing."""
        return self._types.get(name)

    def commit(self, effective: Delta) -> None:
        """Make a change that an `Overlay` on this very state gives as its `delta`."""
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
        """An independent equal state without sources; with `fed`, their latest values are set in it."""
        twin = WorldState(self.schema)
        twin._index(self.facts.copy())
        twin._values = {**self._values, **self._latest} if fed else self._values.copy()
        twin._types = self._types.copy()
        twin._members = {t: members.copy() for t, members in self._members.items()}
        return twin

    def _index(self, facts: FactIndex) -> None:
        self.facts = facts
        self.holds, self.match, self.estimate = facts.holds, facts.match, facts.estimate

    def _add_node(self, name: str, type_name: str) -> None:
        self._types[name] = type_name
        for ancestor in self.schema.ancestors(type_name):
            self._members[ancestor][name] = None

    def _remove_node(self, name: str) -> None:
        """Remove the thing and its values; the change lists its facts itself."""
        for ancestor in self.schema.ancestors(self._types.pop(name)):
            del self._members[ancestor][name]
        self._values = {f: v for f, v in self._values.items() if name not in f.args}
