"""Heartbeats carry the activation tree over a transport: active components name their needs (S1.9, S4.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection
from contextlib import suppress
from typing import Any

from dsc.components.endpoint import Endpoint

BEAT = 0.5
"""Seconds between heartbeats."""
SILENCE = 3.0
"""Seconds without a heartbeat after which a component counts as gone: some may be lost."""

Changed = Callable[[bool], Awaitable[None]]
"""Called when the component becomes active, to take its resources, or inactive, to free them."""


class Heartbeat:
    """One component's part in the activation tree.

    Args:
        endpoint: its address.
        needs: names of the components it needs at present; asked at each beat, so it may depend on its state.
        changed: called when it becomes active or inactive.
        root: active without an activator, as the sequencer is.
    """

    def __init__(
        self, endpoint: Endpoint, needs: Callable[[], Collection[str]], changed: Changed, *, root: bool = False
    ) -> None:
        self._endpoint = endpoint
        self._needs = needs
        self._changed = changed
        self._root = root
        self._activators: dict[str, float] = {}  # with the second of the last heartbeat
        self._stirred = asyncio.Event()
        self.active = False
        endpoint.hear("heartbeat", self._heard)

    @property
    def activators(self) -> frozenset[str]:
        """Names of the components that need it at present."""
        return frozenset(self._activators)

    def stir(self) -> None:
        """Beat immediately: its needs have changed."""
        self._stirred.set()

    async def run(self) -> None:
        """Beat until cancelled; then the component is inactive, and says so."""
        try:
            while True:
                await self._beat()
                self._stirred.clear()
                with suppress(TimeoutError):
                    async with asyncio.timeout(BEAT):
                        await self._stirred.wait()
        finally:
            await self._become(active=False)

    async def _beat(self) -> None:
        now = asyncio.get_running_loop().time()
        self._activators = {name: at for name, at in self._activators.items() if now - at < SILENCE}
        await self._become(active=self._root or bool(self._activators))
        if self.active:
            self._endpoint.broadcast("heartbeat", {"needs": sorted(self._needs())})

    async def _become(self, *, active: bool) -> None:
        if active == self.active:
            return
        self.active = active
        if not active:  # dependants need not wait for silence
            self._endpoint.broadcast("heartbeat", {"needs": []})
        await self._changed(active)

    def need(self, sender: str) -> None:
        """Add an active component that needs this one, without its heartbeat."""
        self._heard(sender, {"needs": [self._endpoint.address]})

    def _heard(self, sender: str, said: Any) -> None:
        needed = self._endpoint.address in said["needs"]
        before = self._activators.pop(sender, None)
        if needed:
            self._activators[sender] = asyncio.get_running_loop().time()
        if needed != (before is not None):
            self.stir()
