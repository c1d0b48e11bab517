"""Signs of life for a service manager: the protocol `sd_notify` of systemd, and of `dsc host --supervised`."""

from __future__ import annotations

import asyncio
import os
import socket

ADDRESS = "NOTIFY_SOCKET"
WATCHDOG = "WATCHDOG_USEC"
"""Environment variables of the protocol: the socket, and the microseconds of silence after which a program hangs."""
READY = b"READY=1"
ALIVE = b"WATCHDOG=1"
_EACH = 0.5
"""Default seconds between signs of life, which also notice the end of the manager."""


class ServiceManager:
    """The manager that has started this program; without one, its methods do nothing or wait.

    Attributes:
        address: the path of its socket; `None` without a manager. A first `@` is an abstract address (Linux).
    """

    def __init__(self, address: str | None = None) -> None:
        self.address = address or os.environ.get(ADDRESS)
        microseconds = os.environ.get(WATCHDOG, "")
        self._each = min(_EACH, int(microseconds) / 2e6) if microseconds.isdigit() else _EACH

    def notify(self, state: bytes) -> bool:
        """Send a state, e.g. `READY`; return whether the manager is there."""
        if self.address is None:
            return True
        path = "\0" + self.address[1:] if self.address.startswith("@") else self.address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.setblocking(False)  # noqa: FBT003
                sender.sendto(state, path)
        except BlockingIOError:  # the manager is busy
            return True
        except OSError:
            return False
        return True

    async def watch(self) -> None:
        """Send signs of life from the event loop, so that a blocked loop is noticed; return when the manager ends."""
        while self.notify(ALIVE):  # noqa: ASYNC110  # a loop that is blocked sends nothing
            await asyncio.sleep(self._each)
