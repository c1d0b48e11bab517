"""Numbers as close to their wishes as their order and distances allow."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

Wish = tuple[float, float]
"""Where something should be, and how much that matters."""


def fit(wishes: Sequence[Sequence[Wish]], distances: Sequence[float]) -> list[float]:
    """Positions that minimise the weighted absolute deviations, by pooling adjacent violators.

    Args:
        wishes: at least one for each position.
        distances: the least distance from each position to the next; one fewer than positions.
    """
    offsets = list(accumulate(distances, initial=0.0))
    blocks: list[tuple[float, int, list[Wish], float]] = []
    for offset, own in zip(offsets, wishes, strict=False):
        pool, size = sorted((value - offset, weight) for value, weight in own), 1
        total = sum(weight for _, weight in own)
        middle = _median(pool, total)
        while blocks and blocks[-1][0] > middle:
            _, more, others, other = blocks.pop()
            pool, size, total = sorted(others + pool), size + more, total + other
            middle = _median(pool, total)
        blocks.append((middle, size, pool, total))
    middles = [middle for middle, size, _, _ in blocks for _ in range(size)]
    return [middle + offset for middle, offset in zip(middles, offsets, strict=False)]


def _median(pool: Sequence[Wish], total: float) -> float:
    """The weighted median; the middle of the possible ones if there are several."""
    half = total / 2
    reached = 0.0
    for index, (value, weight) in enumerate(pool):
        reached += weight
        if reached > half:
            return value
        if reached == half and index + 1 < len(pool):
            return (value + pool[index + 1][0]) / 2
    return pool[-1][0]
