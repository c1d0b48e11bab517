"""Facts by predicate and by each argument, so that a look-up does not depend on how many others there are."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from itertools import chain
from typing import TypeVar

from knowledge_base.facts import Fact, Value

Args = tuple[Value, ...]
_K = TypeVar("_K")
_V = TypeVar("_V")


class FactIndex:
    """A set of facts in order of insertion, indexed per predicate and argument position.

    Dicts with `None` stand for ordered sets. Facts of one argument need no list for it.
    """

    def __init__(self) -> None:
        self._by_predicate: dict[str, dict[Args, Fact]] = {}  # by arguments
        self._by_argument: dict[tuple[str, int, Value], dict[Args, None]] = {}

    def __contains__(self, fact: Fact) -> bool:
        return self.holds(fact.predicate, fact.args)

    def __iter__(self) -> Iterator[Fact]:
        """All facts, predicate by predicate."""
        return chain.from_iterable(known.values() for known in self._by_predicate.values())

    def __len__(self) -> int:
        return sum(map(len, self._by_predicate.values()))

    def holds(self, predicate: str, args: Args) -> bool:
        """Whether the fact is in the set."""
        known = self._by_predicate.get(predicate)
        return known is not None and args in known

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[Args]:
        """The arguments that agree with `pattern` (`None` is open), in order of insertion.

        Looks through the shortest of the lists of facts that have one of the bound arguments. It looks when
        it is iterated, so the set must not change until then.
        """
        listed = self._listed(predicate, pattern)
        exact = len(pattern) < 3 or pattern.count(None) >= len(pattern) - 1
        return listed if exact else _agreeing(listed, pattern)

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """At most how many facts agree with `pattern`, without looking through them."""
        return len(self._listed(predicate, pattern))

    def _listed(self, predicate: str, pattern: tuple[Value | None, ...]) -> Collection[Args]:
        """The shortest list that has all facts which agree with `pattern`."""
        if len(pattern) == 2:  # arcs from or to a thing are asked for so often that it pays
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
        if not known:  # so that the facts alone say in which order the predicates come
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
        twin._by_predicate = _copied(self._by_predicate)
        twin._by_argument = _copied(self._by_argument)
        return twin


def _copied(groups: dict[_K, dict[Args, _V]]) -> dict[_K, dict[Args, _V]]:
    return {key: group.copy() for key, group in groups.items()}


def _agreeing(facts: Iterable[Args], pattern: tuple[Value | None, ...]) -> Iterator[Args]:
    bound = [(i, value) for i, value in enumerate(pattern) if value is not None]
    return (args for args in facts if all(args[i] == value for i, value in bound))
