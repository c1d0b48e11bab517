"""A set of facts, indexed by predicate and argument."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from itertools import chain

from knowledge_base.facts import Fact, Value

Args = tuple[Value, ...]


class FactIndex:
    """A set of facts in order of insertion, indexed by predicate and argument position.

    Dictionaries with the value `None` represent ordered sets. Facts with one argument are not in the argument index.
    """

    def __init__(self) -> None:
        self._by_predicate: dict[str, dict[Args, Fact]] = {}  # by arguments
        self._by_argument: dict[tuple[str, int, Value], dict[Args, None]] = {}

    def __contains__(self, fact: Fact) -> bool:
        return self.holds(fact.predicate, fact.args)

    def __iter__(self) -> Iterator[Fact]:
        """Return an iterator over all facts, grouped by predicate."""
        return chain.from_iterable(map(dict.values, self._by_predicate.values()))

    def __len__(self) -> int:
        return sum(map(len, self._by_predicate.values()))

    def holds(self, predicate: str, args: Args) -> bool:
        """Return whether the fact is in the set."""
        known = self._by_predicate.get(predicate)
        return known is not None and args in known

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[Args]:
        """Return the arguments that match `pattern`, in order of insertion; `None` matches every argument.

        The iterator filters the shortest list of facts with one of the given arguments. The set must not change before
        the end of the iteration.
        """
        listed = self._find_shortest(predicate, pattern)
        exact = len(pattern) < 3 or pattern.count(None) >= len(pattern) - 1
        return listed if exact else _agreeing(listed, pattern)

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """Return an upper bound of the number of facts that match `pattern`, without reading the facts."""
        return len(self._find_shortest(predicate, pattern))

    def _find_shortest(self, predicate: str, pattern: tuple[Value | None, ...]) -> Collection[Args]:
        """Return the shortest list that contains all facts which match `pattern`."""
        if len(pattern) == 2:  # the most frequent pattern: arcs from or to an object
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
        """Append the fact, unless the set contains it already."""
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
        """Remove the fact if the set contains it."""
        predicate, args = fact.predicate, fact.args
        known = self._by_predicate.get(predicate)
        if known is None or args not in known:
            return
        del known[args]
        if not known:  # the order of predicates must depend on the facts alone
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
        """Return an independent set with the same facts in the same order."""
        twin = FactIndex()
        twin._by_predicate = {predicate: known.copy() for predicate, known in self._by_predicate.items()}
        twin._by_argument = {key: listed.copy() for key, listed in self._by_argument.items()}
        return twin


def _agreeing(facts: Iterable[Args], pattern: tuple[Value | None, ...]) -> Iterator[Args]:
    bound = [(i, value) for i, value in enumerate(pattern) if value is not None]
    return (args for args in facts if all(args[i] == value for i, value in bound))
