"""Presence: which addresses of a transport have an endpoint, and the watches of addresses.

A watch compares states and not events: it reports the state at the time of the report. So no two reports can be
reordered, and a disappearance that was over before its report is not reported.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

PresenceChanged = Callable[[bool], None]
"""Function that handles the appearance (`True`) or the disappearance (`False`) of an address."""


@dataclass(slots=True, eq=False)
class _Watch:
    changed: PresenceChanged
    reported: bool = False


class Presence:
    """The holders of each address, e.g. processes, and the watches of addresses; use it only in the loop's own thread.

    Args:
        delay: seconds between a change and its report.
    """

    def __init__(self, delay: float = 0.0) -> None:
        self._delay = delay
        self._holders: dict[str, set[str]] = {}
        self._watches: dict[str, list[_Watch]] = {}

    def appear(self, address: str, holder: str = "") -> None:
        """Add a holder of the address."""
        self._holders.setdefault(address, set()).add(holder)
        self._schedule(address)

    def disappear(self, address: str, holder: str = "") -> None:
        """Remove a holder of the address, if it is one."""
        holders = self._holders.get(address, set())
        holders.discard(holder)
        if not holders:
            self._holders.pop(address, None)
        self._schedule(address)

    def watch(self, address: str, changed: PresenceChanged) -> Callable[[], None]:
        """Report the address's changes, and that it is present now; return the function that ends the reports."""
        watch = _Watch(changed)
        self._watches.setdefault(address, []).append(watch)

        def stop() -> None:
            watches = self._watches.get(address, [])
            if watch in watches:
                watches.remove(watch)
            if not watches:
                self._watches.pop(address, None)

        self._schedule(address)
        return stop

    def _schedule(self, address: str) -> None:
        if address in self._watches:
            asyncio.get_running_loop().call_later(self._delay, self._report, address)

    def _report(self, address: str) -> None:
        present = address in self._holders
        for watch in tuple(self._watches.get(address, ())):
            if watch.reported != present and watch in self._watches.get(address, ()):
                watch.reported = present
                watch.changed(present)
