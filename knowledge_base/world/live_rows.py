"""Rows of relations in one world, which running programs provide."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from knowledge_base.facts import Fact
from knowledge_base.world.fact_index import Args, FactIndex

Rows = Callable[[], Iterable[Args]]
"""Function that returns the present rows of a relation; any thread may call it."""


class LiveRows:
    """The rows of relations in one world, each read on its first use after a change.

    A relation without readers costs nothing.

    Attributes:
        read: the rows that were read since the last change, by relation.
        new: the rows that were read since the last `take_new`.
    """

    def __init__(self) -> None:
        self._providers: dict[str, list[Rows]] = {}
        self.read: dict[str, FactIndex] = {}
        self.new: dict[str, FactIndex] = {}

    def __bool__(self) -> bool:
        return bool(self._providers)

    def __contains__(self, name: object) -> bool:
        return name in self._providers

    def provide(self, rows: Mapping[str, Rows]) -> None:
        """Add a provider of rows for some relations."""
        for name, one in rows.items():
            self._providers.setdefault(name, []).append(one)

    def withdraw(self, rows: Mapping[str, Rows]) -> None:
        """Remove a provider."""
        for name, one in rows.items():
            self._providers[name].remove(one)
            if not self._providers[name]:
                del self._providers[name]

    def of(self, name: str) -> FactIndex:
        """Return the present rows of a relation."""
        found = self.read.get(name)
        if found is None:
            found = FactIndex()
            for provider in self._providers.get(name, ()):
                for args in provider():
                    found.add(Fact(name, args))
            self.read[name] = self.new[name] = found
        return found

    def take_new(self) -> dict[str, FactIndex]:
        """Return the rows that were read since the last call."""
        new, self.new = self.new, {}
        return new

    def news(self, names: Iterable[str], watched: Callable[[str], bool]) -> tuple[list[Fact], list[Fact]]:
        """Forget rows; return the facts of watched relations that have ended, and those that have begun, since then."""
        ended: list[Fact] = []
        begun: list[Fact] = []
        for name in names:
            old = self.read.pop(name, None)
            if old is not None and watched(name):
                new = self.of(name)
                ended += [one for one in old if one not in new]
                begun += [one for one in new if one not in old]
        return ended, begun
