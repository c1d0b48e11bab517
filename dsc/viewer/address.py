"""Address of a page: a port of this machine, the token that opens it, and a one-time code."""

from __future__ import annotations

import secrets
import socket
from dataclasses import dataclass, field

from knowledge_base.errors import InputError


@dataclass(frozen=True, slots=True)
class PageAddress:
    """A listening socket on 127.0.0.1, bound before the server starts, so that the address is known immediately.

    Attributes:
        listening: the socket; early connections wait for the server.
        token: a key that opens the page any number of times.
        code: a key that opens the page once, soon after the server's start.
    """

    listening: socket.socket
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)
    code: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)

    @classmethod
    def on(cls, port: int = 0) -> PageAddress:
        """Listen on the port, with new keys; port 0 picks a free one.

        Raises:
            InputError: another program listens there.
        """
        made = socket.socket()
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            made.bind(("127.0.0.1", port))
            made.listen()
        except OSError as error:
            made.close()
            raise InputError(f"cannot listen on port {port}: {error.strerror}") from None
        return cls(made)

    @property
    def port(self) -> int:
        """The port's number."""
        number: int = self.listening.getsockname()[1]
        return number

    @property
    def url(self) -> str:
        """The address for people; it works any number of times."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    @property
    def one_time_url(self) -> str:
        """The address for a browser's command line, which others can read: it works once."""
        return f"http://127.0.0.1:{self.port}/?code={self.code}"
