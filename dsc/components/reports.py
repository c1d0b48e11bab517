"""The intermediate events of one action on their way: a bounded number waits, further ones are conflated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dsc.calls import Outcome
from knowledge_base.facts import Delta

MOST_WAITING = 5_000
"""Reports of one action that wait to be taken; 750 bytes each, and a run takes some 10,000 in a second."""
_AT_ONCE = 250
"""Observations that become one change together: each such merge takes as long as the change is large."""


class Reports:
    """Posts reports in their order, at most `MOST_WAITING` that were not taken.

    Of further ones the newest of each event waits aside. Their observations become one change, so that no knowledge is
    lost. All of it is posted when half of the others are taken, or at the end.

    Args:
        post: receives a report, and how many older ones of its event it stands for.
    """

    __slots__ = ("_aside", "_observed", "_post", "_waiting")

    def __init__(self, post: Callable[[Outcome, int], None]) -> None:
        self._post = post
        self._waiting = 0
        self._aside: dict[str, tuple[Mapping[str, Any], int]] = {}
        self._observed: list[Delta] = []

    def put(self, report: Outcome) -> None:
        """Post a report, now or later."""
        if self._waiting < MOST_WAITING and not self._aside:
            self._waiting += 1
            self._post(report, 0)
            return
        _, conflated = self._aside.pop(report.event, (None, -1))
        self._aside[report.event] = report.attributes, conflated + 1
        if report.observed:
            self._observed.append(report.observed)
            if len(self._observed) > _AT_ONCE:
                self._observed = [_as_one(self._observed)]

    def taken(self) -> None:
        """One that was posted waits no more."""
        self._waiting -= 1
        if self._aside and self._waiting <= MOST_WAITING // 2:
            self.flush()

    def flush(self) -> None:
        """Post what waits aside; what was observed comes with the first of them."""
        if not self._aside:
            return
        aside, self._aside = self._aside, {}
        observed, self._observed = _as_one(self._observed), []
        for event, (attributes, conflated) in aside.items():
            self._waiting += 1
            self._post(Outcome(event, attributes, observed), conflated)
            observed = Delta()


def _as_one(observed: list[Delta]) -> Delta:
    """One change after the other as a single one; halves first, as most are small."""
    if len(observed) < 2:
        return observed[0] if observed else Delta()
    half = len(observed) // 2
    return _as_one(observed[:half]).then(_as_one(observed[half:]))
