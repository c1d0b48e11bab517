"""Heartbeats: the activation tree over a transport; active components broadcast their needs (S1.9, S4.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection
from contextlib import suppress
from functools import partial
from typing import Any

from dsc.wire.endpoint import Endpoint

BEAT = 0.5
"""Seconds between heartbeats."""
SILENCE = 3.0
"""Seconds without a heartbeat after which a component counts as gone, as single heartbeats may be lost."""

Changed = Callable[[bool], Awaitable[None]]
"""Function that acquires a component's resources when it becomes active (`True`), and releases them otherwise."""


class Heartbeat:
    """One component's part in the activation tree.

    Args:
        endpoint: the component's address.
        needs: returns the names of the components that this one needs at present; called at each heartbeat.
        changed: called when the component becomes active or inactive.
        root: whether the component is active without an activator, like the sequencer.
        busy: returns whether the component works at present, and therefore stays active without an activator.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        needs: Callable[[], Collection[str]],
        changed: Changed,
        *,
        root: bool = False,
        busy: Callable[[], bool] = lambda: False,
    ) -> None:
        self._endpoint = endpoint
        self._needs = needs
        self._changed = changed
        self._root = root
        self._busy = busy
        self._activators: dict[str, float] = {}  # by name, the loop time of the last heartbeat
        self._watches: dict[str, Callable[[], None]] = {}  # by activator, how to end its watch
        self._stirred = asyncio.Event()
        self.active = False
        endpoint.receive("heartbeat", self._receive)

    @property
    def activators(self) -> frozenset[str]:
        """Names of the components that need this one at present."""
        return frozenset(self._activators)

    def stir(self) -> None:
        """Send a heartbeat immediately, as the needs have changed."""
        self._stirred.set()

    async def run(self) -> None:
        """Send heartbeats until cancelled.

        Then the component becomes inactive, and broadcasts that it needs nothing.
        """
        try:
            while True:
                await self._beat()
                self._stirred.clear()
                with suppress(TimeoutError):
                    async with asyncio.timeout(BEAT):
                        await self._stirred.wait()
        finally:
            for name in tuple(self._activators):
                self._remove(name)
            await self._become(active=False)

    async def _beat(self) -> None:
        now = asyncio.get_running_loop().time()
        for silent in [name for name, at in self._activators.items() if now - at >= SILENCE]:
            self._remove(silent)
        await self._become(active=self._root or bool(self._activators) or self._busy())
        if self.active:
            self._endpoint.broadcast("heartbeat", {"needs": sorted(self._needs())})

    async def _become(self, *, active: bool) -> None:
        if active == self.active:
            return
        self.active = active
        if not active:  # dependencies need not wait for `SILENCE`
            self._endpoint.broadcast("heartbeat", {"needs": []})
        await self._changed(active)

    def need(self, sender: str) -> None:
        """Add an active component that needs this one, without waiting for its heartbeat."""
        self._receive(sender, {"needs": [self._endpoint.address]})

    def _receive(self, sender: str, said: Any) -> None:
        if self._endpoint.address not in said["needs"]:
            self._remove(sender)
            return
        if sender not in self._activators:
            self._watches[sender] = self._endpoint.watch(sender, partial(self._note_presence, sender))
            self.stir()
        self._activators[sender] = asyncio.get_running_loop().time()

    def _note_presence(self, activator: str, present: bool) -> None:  # noqa: FBT001
        if not present:
            self._remove(activator)

    def _remove(self, activator: str) -> None:
        """Remove an activator, if it is one: it needs this component no longer, or is gone."""
        if self._activators.pop(activator, None) is not None:
            self._watches.pop(activator)()
            self.stir()
