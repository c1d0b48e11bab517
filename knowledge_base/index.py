"""Facts by predicate and by each argument, so that a look-up does not depend on how many others there are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

from knowledge_base.facts import Fact, Value

Args = tuple[Value, ...]
_K = TypeVar("_K")


class FactIndex:
    """A set of facts in order of insertion, indexed per predicate and argument position.

    Dicts with `None` stand for ordered sets.
    """

    def __init__(self) -> None:
        self._facts: dict[str, dict[Args, None]] = {}
        self._by_argument: dict[tuple[str, int, Value], dict[Args, None]] = {}

    def __contains__(self, fact: Fact) -> bool:
        return self.holds(fact.predicate, fact.args)

    def __iter__(self) -> Iterator[Fact]:
        """All facts, predicate by predicate."""
        return (Fact(predicate, args) for predicate, known in self._facts.items() for args in known)

    def __len__(self) -> int:
        return sum(map(len, self._facts.values()))

    def holds(self, predicate: str, args: Args) -> bool:
        """Whether the fact is in the set."""
        known = self._facts.get(predicate)
        return known is not None and args in known

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[Args]:
        """The arguments that agree with `pattern` (`None` is open), in order of insertion.

        Looks through the shortest of the lists of facts that have one of the bound arguments. It looks when
        it is iterated, so the set must not change until then.
        """
        bound = [(i, value) for i, value in enumerate(pattern) if value is not None]
        if not bound:
            return iter(self._facts.get(predicate, ()))
        lists = [self._by_argument.get((predicate, i, value)) for i, value in bound]
        found = [known for known in lists if known is not None]
        if len(found) < len(bound):
            return ()
        shortest = min(found, key=len)
        if len(bound) == 1:
            return iter(shortest)
        return (args for args in shortest if all(args[i] == value for i, value in bound))

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """At most how many facts agree with `pattern`, without looking through them."""
        sizes = [
            len(self._by_argument.get((predicate, i, value), ()))
            for i, value in enumerate(pattern)
            if value is not None
        ]
        return min(sizes, default=len(self._facts.get(predicate, ())))

    def add(self, fact: Fact) -> None:
        """Put the fact at the end, unless it is there."""
        known = self._facts.setdefault(fact.predicate, {})
        if fact.args in known:
            return
        known[fact.args] = None
        for key in _keys(fact):
            self._by_argument.setdefault(key, {})[fact.args] = None

    def discard(self, fact: Fact) -> None:
        """Take the fact out, if it is there."""
        known = self._facts.get(fact.predicate, {})
        if fact.args not in known:
            return
        del known[fact.args]
        if not known:  # so that the facts alone say in which order the predicates come
            del self._facts[fact.predicate]
        for key in _keys(fact):
            listed = self._by_argument[key]
            del listed[fact.args]
            if not listed:
                del self._by_argument[key]

    def copy(self) -> FactIndex:
        """An independent set with the same facts in the same order."""
        twin = FactIndex()
        twin._facts = _copied(self._facts)
        twin._by_argument = _copied(self._by_argument)
        return twin


def _copied(groups: dict[_K, dict[Args, None]]) -> dict[_K, dict[Args, None]]:
    return {key: group.copy() for key, group in groups.items()}


def _keys(fact: Fact) -> Iterator[tuple[str, int, Value]]:
    return ((fact.predicate, i, value) for i, value in enumerate(fact.args))
