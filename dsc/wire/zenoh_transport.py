"""A transport between processes and machines, on a session of Zenoh; needs the extra `zenoh`.

Each address has a key below the realm, `<realm>/to/<address>`. Frames to all addresses have the key `<realm>/all`. The
sender travels as the attachment. A liveliness token `<realm>/alive/<address>/<session>` reports the presence of an
address. Zenoh removes the tokens of a program immediately when its connection is closed, e.g. by `kill -9`, and after
`lease` seconds when it is silent.

No other module imports zenoh.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self
from urllib.parse import quote, unquote

from dsc.run_log import run_logger
from dsc.wire.endpoint import BROADCAST, MOST_BYTES, Receive, require_free
from dsc.wire.presence import Presence, PresenceChanged
from knowledge_base.errors import InputError
from knowledge_base.user_objects import described

if TYPE_CHECKING:
    import zenoh
    from zenoh.handlers import Callback

_LOG = run_logger(__package__)

LOOPBACK = ("tcp/127.0.0.1:0",)
"""Default endpoints to listen on: a free port, which only programs of this machine can reach."""
LEASE = 2.0
"""Default seconds without a message after which Zenoh closes a connection; four messages are sent in this time."""
MOST_PUBLISHERS = 1_000
"""Number of addresses whose route a transport remembers; the address that was not used for longest is forgotten."""
_WITH_PORT = re.compile(r"(tcp|udp|tls|quic|ws)/(\[[^]]+\]|[^:/]+):\d{1,5}([?#].*)?")
_WITHOUT_PORT = re.compile(r"(unixsock-stream|serial|vsock|unixpipe)/.+")


class _Attached(NamedTuple):
    """An attached address; its subscriber and token end with `undeclare`."""

    receive: Receive
    subscriber: zenoh.Subscriber[None]
    token: zenoh.LivelinessToken


class ZenohTransport:
    """A transport on a session of Zenoh; one of several transports of a realm, in any processes.

    Transports find each other through one that all connect to; then each connects to all others. They may start in any
    order. Use a transport in one event loop at a time.

    Args:
        realm: the name that all transports of a robot share; other realms are separate.
        listen: endpoints to listen on, e.g. `tcp/127.0.0.1:7447`; by default `LOOPBACK`.
        connect: endpoints of other transports, which may start later.
        scouting: whether to search for other transports by multicast; by default not.
        lease: seconds of silence after which another program counts as gone; by default `LEASE`.
        config: file with Zenoh's own settings, e.g. certificates and access control. An argument above replaces the
            setting in the file; without the argument, the file's setting or Zenoh's own default applies.

    Attributes:
        realm: the name of the realm.

    Raises:
        InputError: the extra is not installed, an endpoint is malformed or in use, or the file cannot be read.
    """

    def __init__(
        self,
        realm: str = "dsc",
        *,
        listen: Collection[str] | None = None,
        connect: Collection[str] | None = None,
        scouting: bool | None = None,
        lease: float | None = None,
        config: str | Path | None = None,
    ) -> None:
        for endpoint in (*(listen or ()), *(connect or ())):
            _require_endpoint(endpoint)
        if lease is not None and not 0.1 <= lease <= 3600:
            raise InputError(f"the lease is between 0.1 and 3600 seconds, not {lease:g}", found=str(lease))
        milliseconds = lease and round(1000 * lease)
        given = {
            "listen/endpoints": listen and list(listen),
            "connect/endpoints": connect and list(connect),
            "scouting/multicast/enabled": scouting,
            "transport/link/tx/lease": milliseconds,
            "transport/unicast/open_timeout": milliseconds,
        }
        settings = {} if config else dict(_DEFAULTS)
        self._session = _session(config, settings | {key: value for key, value in given.items() if value is not None})
        self.realm = realm
        self._id = str(self._session.zid())
        self._realm = _chunk(realm)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._attached: dict[str, _Attached] = {}
        self._publishers: dict[str, zenoh.Publisher] = {}  # by address, the last used one at the end
        self._presence = Presence()
        self._observer: zenoh.Subscriber[None] | None = None  # of the tokens, since the first watch
        self._session.declare_subscriber(f"{self._realm}/all", _direct(lambda one: self._receive(BROADCAST, one)))

    def attach(self, address: str, receive: Receive) -> None:
        """Pass frames for the address to `receive`; raise `InputError` if this transport has attached the address."""
        require_free(address, self._attached)
        self._loop = asyncio.get_running_loop()
        self._attached[address] = _Attached(
            receive,
            self._session.declare_subscriber(
                self._key("to", address), _direct(lambda one: self._receive(address, one))
            ),
            self._session.liveliness().declare_token(f"{self._key('alive', address)}/{self._id}"),
        )

    def detach(self, address: str) -> None:
        """Stop passing frames for the address, if it is attached."""
        attached = self._attached.pop(address, None)
        if attached is not None:
            attached.subscriber.undeclare()  # type: ignore[no-untyped-call]
            attached.token.undeclare()  # type: ignore[no-untyped-call]

    def send(self, sender: str, to: str, frame: bytes) -> None:
        """Send a frame to an address, or to `BROADCAST`; it is lost if no program has the address, or after `close`."""
        self._loop = asyncio.get_running_loop()  # a later loop may use endpoints that an earlier one has attached
        if not self._session.is_closed():
            self._publisher(to).put(frame, attachment=sender.encode(errors="surrogateescape"))

    def watch(self, address: str, changed: PresenceChanged) -> Callable[[], None]:
        """Report whether a transport of the realm has attached the address, as `Transport.watch`."""
        self._loop = asyncio.get_running_loop()
        if self._observer is None:
            tokens = f"{self._realm}/alive/*/*"
            self._observer = self._session.liveliness().declare_subscriber(tokens, _direct(self._observe), history=True)
        return self._presence.watch(address, changed)

    async def addresses(self) -> set[str]:
        """Return the addresses that all transports of the realm have attached."""

        def ask() -> set[str]:
            replies = self._session.liveliness().get(f"{self._realm}/alive/*/*", timeout=LEASE)
            keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
            return {_address(key.split("/")[-2]) for key in keys}

        return await asyncio.to_thread(ask)

    def close(self) -> None:
        """Detach all addresses, and close the session."""
        for address in tuple(self._attached):
            self.detach(address)
        self._publishers.clear()
        try:
            self._session.close()  # type: ignore[no-untyped-call]
        except Exception as error:  # noqa: BLE001  # e.g. a time limit of Zenoh; its threads end with the program
            _LOG.warning("Zenoh could not close its session: %s", _reason(error))

    def __enter__(self) -> Self:
        """Return the transport, which the end of the block closes."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the transport."""
        self.close()

    # -- in threads of Zenoh -------------------------------------------------------------------------------

    def _receive(self, to: str, sample: zenoh.Sample) -> None:
        attachment = sample.attachment
        if attachment is not None:
            sender = attachment.to_bytes().decode(errors="surrogateescape")
            self._call_in_loop(self._deliver, sender, to, sample.payload.to_bytes())

    def _observe(self, sample: zenoh.Sample) -> None:
        *_, address, session = str(sample.key_expr).split("/")
        appeared = sample.kind == sample.kind.PUT
        change = self._presence.appear if appeared else self._presence.disappear
        self._call_in_loop(change, _address(address), session)

    def _call_in_loop(self, call: Callable[..., None], *arguments: Any) -> None:
        """Call a function in the loop's thread, in the order of the calls; a closed loop has no receivers."""
        loop = self._loop
        if loop is not None:
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(call, *arguments)

    # -- in the loop's thread ------------------------------------------------------------------------------

    def _deliver(self, sender: str, to: str, frame: bytes) -> None:
        """Pass a frame to the receivers that are attached now; the address may have been detached in the meantime."""
        others = [address for address in self._attached if address != sender] if to == BROADCAST else [to]
        for address in others:
            attached = self._attached.get(address)
            if attached is not None:
                attached.receive(sender, frame)

    def _publisher(self, to: str) -> zenoh.Publisher:
        """Return the publisher for an address; Zenoh computes its route one time, and not for each frame."""
        publisher = self._publishers.pop(to, None)
        if publisher is None:
            key = f"{self._realm}/all" if to == BROADCAST else self._key("to", to)
            publisher = self._session.declare_publisher(key)
            if len(self._publishers) >= MOST_PUBLISHERS:
                oldest = next(iter(self._publishers))
                self._publishers.pop(oldest).undeclare()  # type: ignore[no-untyped-call]
        self._publishers[to] = publisher
        return publisher

    def _key(self, kind: str, address: str) -> str:
        return f"{self._realm}/{kind}/{_chunk(address)}"


def _direct(receive: Callable[[zenoh.Sample], None]) -> Callback[zenoh.Sample]:
    """Return a callback that Zenoh calls in its own threads.

    Without this, Zenoh starts a thread for each subscriber, which delays frames and outlasts a program without `close`.
    """
    from zenoh.handlers import Callback  # noqa: PLC0415  an extra

    return Callback(receive, indirect=False)


_DEFAULTS = {
    "mode": "peer",
    "listen/endpoints": list(LOOPBACK),
    "scouting/multicast/enabled": False,
    "transport/link/tx/lease": round(1000 * LEASE),
    "transport/unicast/open_timeout": round(1000 * LEASE),  # `close` waits for an attempt to reach a program that hangs
    "transport/link/rx/max_message_size": 2 * MOST_BYTES,  # a frame with its key and sender
}
"""Zenoh's settings without a file; Zenoh's own defaults listen on all networks of the machine."""


def _chunk(name: str) -> str:
    """Return a name as one part of a key: without `/` and the characters of patterns, and never empty."""
    return quote(name, safe="", errors="surrogateescape") or "%"


def _address(chunk: str) -> str:
    """Return the name of which `_chunk` has made a part of a key."""
    return "" if chunk == "%" else unquote(chunk, errors="surrogateescape")


def _require_endpoint(text: str) -> None:
    """Raise `InputError` for a text that is not an endpoint of Zenoh, which Zenoh itself would retry without end."""
    if not (_WITH_PORT.fullmatch(text) or _WITHOUT_PORT.fullmatch(text)):
        raise InputError(
            f"'{text}' is not an endpoint of Zenoh: write protocol, host and port, such as 'tcp/192.168.0.7:7447'",
            found=text,
        )


def _session(config: str | Path | None, settings: dict[str, Any]) -> zenoh.Session:
    try:
        import zenoh  # noqa: PLC0415  an extra, which only this transport needs
    except ModuleNotFoundError as error:
        message = "the transport over Zenoh needs eclipse-zenoh: pip install 'dynamic-state-charts[zenoh]'"
        raise InputError(message, found="zenoh") from error
    if config and not Path(config).is_file():  # Zenoh would wait for the end of a pipe
        raise InputError(f"the settings of Zenoh are a file, and '{config}' is none", found=str(config))
    try:
        read = zenoh.Config.from_file(config) if config else zenoh.Config()
    except zenoh.ZError as error:
        raise InputError(f"the settings of Zenoh cannot be read: {_reason(error)}", found=str(config)) from None
    try:
        for key, value in settings.items():
            read.insert_json5(key, json.dumps(value))
        return zenoh.open(read)
    except zenoh.ZError as error:
        reason = _reason(error)
        remedy = next((remedy for found, remedy in _REMEDIES.items() if found in reason), "")
        raise InputError(f"Zenoh cannot be started: {reason}{remedy}") from None


IN_USE = "Address already in use"
"""Part of the error about an endpoint on which another program listens."""
_REMEDIES = {
    IN_USE: "; end the program that listens there, or listen on another port (0 chooses a free one)",
    "Cannot assign requested address": "; listen on an address of this machine",
    "failed to lookup address": "; listen on an address of this machine",
    "Unable to connect": "; start the program that listens there, or correct the endpoint",
}
"""Parts of Zenoh's errors, each with its remedy."""


def _reason(error: Exception) -> str:
    """Return the text of an error of Zenoh without the places in Zenoh's own source."""
    return re.sub(r" at \S+\.rs:\d+\.?", "", described(error, named=False))
