"""How frames travel between components. A transport may do without guarantees: `Endpoint` makes up for that."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from knowledge_base.errors import InputError

Receive = Callable[[str, bytes], None]
"""Is given the sender's address and a frame."""
EVERYBODY = "*"
"""The address of all who are attached, but for the sender."""


class Transport(Protocol):
    """Carries frames, at its best; `dsc.testing.transport_suite` is what it has to pass."""

    def attach(self, address: str, receive: Receive) -> None:
        """Hand frames for the address to `receive`, from the loop's own thread.

        Raises:
            InputError: somebody in this program has the address already; both would share its `Endpoint`.
        """
        ...

    def detach(self, address: str) -> None:
        """Hand over no more frames for the address; nothing happens if nobody is there."""
        ...

    def send(self, sender: str, to: str, frame: bytes) -> None:
        """Send a frame to an address, or to `EVERYBODY`. It may be lost, doubled, late, or overtaken."""
        ...


class LocalTransport:
    """Inside one process: every frame arrives, once, in order."""

    def __init__(self) -> None:
        self._attached: dict[str, Receive] = {}

    def attach(self, address: str, receive: Receive) -> None:
        """Hand frames for the address to `receive`; raises `InputError` if somebody else has it."""
        if address in self._attached:
            message = f"the address '{address}' is in use: share its endpoint (`host.endpoint`), or close it first"
            raise InputError(message, found=address)
        self._attached[address] = receive

    def detach(self, address: str) -> None:
        """Hand over no more frames for the address."""
        self._attached.pop(address, None)

    def send(self, sender: str, to: str, frame: bytes) -> None:
        """Send a frame; it arrives with the loop's next turn."""
        asyncio.get_running_loop().call_soon(self.deliver, sender, to, frame)

    def deliver(self, sender: str, to: str, frame: bytes) -> None:
        """Hand a frame over now."""
        others = [address for address in self._attached if address != sender] if to == EVERYBODY else [to]
        for address in others:
            receive = self._attached.get(address)  # who hears first may have detached the next
            if receive is not None:
                receive(sender, frame)
