"""Few control flows for a partial order: a minimum chain cover (Dilworth 1950), found by matching (Fulkerson 1956)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

Kin = Callable[[int, int], bool]
"""Whether two steps are better kept in one chain, e.g. because one robot takes both."""


def chains(earlier: Mapping[int, frozenset[int]], kin: Kin) -> tuple[tuple[int, ...], ...]:
    """The fewest chains that hold each step once, by their first steps.

    A chain is a sequence of steps each of which ends before the next begins. Of all covers with the fewest chains,
    one is taken that keeps kin together as far as a matching of kin alone can be kept.

    Args:
        earlier: for each step in order, all that end before it begins.
        kin: see there.
    """
    matching = _Matching(earlier)
    for relatives in (kin, _anybody):
        for second in earlier:
            matching.follow(second, relatives)
    following = {first: second for second, first in matching.before.items()}
    return tuple(_chain(first, following) for first in earlier if first not in matching.before)


def _anybody(_first: int, _second: int) -> bool:
    return True


def _chain(first: int, following: Mapping[int, int]) -> tuple[int, ...]:
    chain = [first]
    while chain[-1] in following:
        chain.append(following[chain[-1]])
    return tuple(chain)


class _Matching:
    """Who comes directly before whom; `follow` makes it larger by one along an augmenting path, if there is any."""

    def __init__(self, earlier: Mapping[int, frozenset[int]]) -> None:
        self.before: dict[int, int] = {}
        self._after: dict[int, int] = {}
        self._earlier = {number: sorted(those, reverse=True) for number, those in earlier.items()}

    def follow(self, second: int, kin: Kin) -> None:
        """Let a step come directly after another one, if it does not yet."""
        if second not in self.before:
            self._augment(second, kin, set())

    def _augment(self, second: int, kin: Kin, tried: set[int]) -> bool:
        for first in self._earlier[second]:
            if first in tried or not kin(first, second):
                continue
            tried.add(first)
            other = self._after.get(first)
            if other is None or self._augment(other, kin, tried):
                self.before[second], self._after[first] = first, second
                return True
        return False
