"""Tracks of lines between two layers: a separate track for each horizontal part, with few crossings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

CLOSE = 8.0
"""Lines nearer than this to each other look like one."""
MANY = 40
"""Number of lines from which tracks are shared first, without counting crossings."""
SAME_LINE = 100
"""Number of crossings that weigh as much as two lines on top of each other."""


@dataclass(frozen=True, slots=True)
class Net:
    """Lines with a common horizontal part, their positions above it and below it."""

    tops: tuple[float, ...]
    bottoms: tuple[float, ...]

    @property
    def low(self) -> float:
        """Its left end."""
        return min(*self.tops, *self.bottoms)

    @property
    def high(self) -> float:
        """Its right end."""
        return max(*self.tops, *self.bottoms)

    @property
    def straight(self) -> bool:
        """Whether it needs no track."""
        return self.high == self.low


def assign_tracks(nets: Sequence[Net]) -> list[int]:
    """Return the track of every net, counted from the top; nets that overlap never share one."""
    bent = [number for number, net in enumerate(nets) if not net.straight]
    order = sorted(bent, key=lambda number: (nets[number].low, nets[number].high))
    tracks = [0] * len(nets)
    if len(bent) > MANY:
        _first_fit(nets, order, tracks)
        return tracks
    order = _least_crossing(nets, order)
    for place, number in enumerate(order):
        above = [tracks[other] for other in order[:place] if _overlap(nets[other], nets[number])]
        tracks[number] = 1 + max(above, default=-1)
    return tracks


def _first_fit(nets: Sequence[Net], order: Iterable[int], tracks: list[int]) -> None:
    ends: list[float] = []
    for number in order:
        net = nets[number]
        free = (track for track, end in enumerate(ends) if end + CLOSE < net.low)
        tracks[number] = next(free, len(ends))
        ends[tracks[number] : tracks[number] + 1] = [net.high]


def _least_crossing(nets: Sequence[Net], order: list[int]) -> list[int]:
    """Greedy: the next net is the one with the largest gain above all remaining ones."""
    gain = {(a, b): _cost(nets[b], nets[a]) - _cost(nets[a], nets[b]) for a in order for b in order}
    score = {a: sum(gain[a, b] for b in order) for a in order}
    result = []
    while score:
        first = max(score, key=score.__getitem__)
        del score[first]
        for other in score:
            score[other] -= gain[other, first]
        result.append(first)
    return result


def _cost(above: Net, below: Net) -> int:
    """Return the cost of one net above another."""
    cost = sum(below.low < x < below.high for x in above.bottoms)
    cost += sum(above.low < x < above.high for x in below.tops)
    shared = any(abs(x - other) < CLOSE / 2 for x in above.bottoms for other in below.tops)
    return cost + SAME_LINE * shared


def _overlap(one: Net, other: Net) -> bool:
    return one.low < other.high + CLOSE and other.low < one.high + CLOSE
