"""Few control flows for a partial order: a minimum chain cover (Dilworth 1950), found by matching (Fulkerson 1956)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

Kin = Callable[[int, int], bool]
"""Returns whether two steps should share a chain, e.g. because one robot takes both."""


def chains(earlier: Mapping[int, frozenset[int]], kin: Kin) -> tuple[tuple[int, ...], ...]:
    """Return the fewest chains that contain each step once, ordered by their first steps.

    A chain is a sequence of steps each of which ends before the next begins. Among the covers with the fewest chains,
    the result extends a maximum matching of kin.

    Args:
        earlier: for each step in order, the steps that end before it begins.
        kin: see `Kin`.
    """
    matching = _Matching(earlier)
    for relatives in (kin, _any_pair):
        for second in earlier:
            matching.follow(second, relatives)
    following = {first: second for second, first in matching.before.items()}
    return tuple(_chain(first, following) for first in earlier if first not in matching.before)


def _any_pair(_first: int, _second: int) -> bool:
    return True


def _chain(first: int, following: Mapping[int, int]) -> tuple[int, ...]:
    chain = [first]
    while chain[-1] in following:
        chain.append(following[chain[-1]])
    return tuple(chain)


class _Matching:
    """A matching of steps with their direct predecessors; `follow` extends it along an augmenting path."""

    def __init__(self, earlier: Mapping[int, frozenset[int]]) -> None:
        self.before: dict[int, int] = {}
        self._after: dict[int, int] = {}
        self._earlier = {number: sorted(those, reverse=True) for number, those in earlier.items()}

    def follow(self, second: int, kin: Kin) -> None:
        """Give a step a direct predecessor if it has none and the matching allows one."""
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
