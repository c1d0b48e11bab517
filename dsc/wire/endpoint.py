"""Endpoints: addresses on a transport, for calls that are executed at most once, and for pushes.

An endpoint repeats a call until its answer arrives. The receiver stores the answer until the caller has received it. So
every pattern with an answer (query, param, state, send, event) tolerates loss, duplicates and reordering of frames. A
receiver that still executes a call answers each repetition with the frame `running`. So a call may take any time, and
raises `NoAnswerError` only after a silence. Pushes are sent one time; a push that arrives after a newer one is dropped.

Any bytes may arrive. A malformed frame, or a frame beyond a bound, is dropped and counted; its caller sends it again.
An endpoint remembers a peer until `REMEMBERED` seconds after the peer's last frame. So a flood of frames from new
addresses cannot cause a second execution of a call.
"""

from __future__ import annotations

import asyncio
import json
import secrets
from collections import Counter
from collections.abc import Awaitable, Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from dsc.components.frames import encoded
from dsc.components.hooks import contained, reason_of
from dsc.errors import NoAnswerError, ProgrammingError, RefusedError
from dsc.wire.presence import Presence, PresenceChanged
from knowledge_base.errors import InputError
from knowledge_base.user_objects import text_of

Answers = Callable[[str, Any], Awaitable[Any]]
"""Function that answers a call; receives the sender's address and the body."""
FrameReceiver = Callable[[str, Any], None]
"""Function that handles a push; receives the sender's address and the body."""
Receive = Callable[[str, bytes], None]
"""Function that handles a frame; receives the sender's address and the frame."""
BROADCAST = "*"
"""The address of all attached endpoints except the sender."""
WITHIN = 5.0
"""Default bound of the silence during a call, in seconds."""
AGAIN = 0.2
"""Seconds after which an unanswered call is sent again."""
RESOLUTION = 1e-6
"""Seconds below which a remaining time counts as over; the loop's time, a float, could not advance by less."""
MOST_PEERS = 1_000
"""Number of senders that an endpoint remembers; a restarted sender counts as a new one."""
REMEMBERED = 60.0
"""Seconds without a frame after which a full endpoint may forget a sender."""
MOST_CALLS = 1_000
"""Number of calls of one sender that are running, or whose answer the sender may still need."""
MOST_BYTES = 16 << 20
"""Maximum number of bytes of a frame."""
_LONGEST = 1_000
"""Maximum number of characters of a `kind` or `life` in a frame."""


class Transport(Protocol):
    """A carrier of frames without guarantees; `dsc.testing.transport_suite` tests an implementation."""

    def attach(self, address: str, receive: Receive) -> None:
        """Pass frames for the address to `receive`, from the loop's own thread.

        Raises:
            InputError: another endpoint in this program has the address.
        """
        ...

    def detach(self, address: str) -> None:
        """Stop passing frames for the address, if it is attached."""
        ...

    def send(self, sender: str, to: str, frame: bytes) -> None:
        """Send a frame to an address, or to `BROADCAST`. The frame may be lost, duplicated, delayed, or overtaken."""
        ...

    def watch(self, address: str, changed: PresenceChanged) -> Callable[[], None]:
        """Report whether any program has attached the address, from the loop's own thread; a report may be late.

        The first report is `changed(True)`, now or when the address appears. `changed(False)` follows when its program
        has detached it, has ended, or cannot be reached, and `changed(True)` when it returns.

        Returns:
            A function that ends the reports.
        """
        ...


def require_free(address: str, attached: Collection[str]) -> None:
    """Raise `InputError` if the address is among the attached ones."""
    if address in attached:
        message = f"the address '{address}' is in use: share its endpoint (`host.endpoint`), or close it first"
        raise InputError(message, found=address)


class LocalTransport:
    """A transport inside one process: every frame arrives, one time, in order."""

    def __init__(self) -> None:
        self._attached: dict[str, Receive] = {}
        self._presence = Presence()

    def attach(self, address: str, receive: Receive) -> None:
        """Pass frames for the address to `receive`; raise `InputError` if the address is in use."""
        require_free(address, self._attached)
        self._attached[address] = receive
        self._presence.appear(address)

    def detach(self, address: str) -> None:
        """Stop passing frames for the address."""
        self._attached.pop(address, None)
        self._presence.disappear(address)

    def watch(self, address: str, changed: PresenceChanged) -> Callable[[], None]:
        """Report whether the address is attached, in a later iteration of the loop."""
        return self._presence.watch(address, changed)

    def send(self, sender: str, to: str, frame: bytes) -> None:
        """Send a frame; it arrives in the next iteration of the loop."""
        asyncio.get_running_loop().call_soon(self.deliver, sender, to, frame)

    def deliver(self, sender: str, to: str, frame: bytes) -> None:
        """Pass a frame to its receivers immediately."""
        others = [address for address in self._attached if address != sender] if to == BROADCAST else [to]
        for address in others:
            receive = self._attached.get(address)  # an earlier receiver may have detached the address
            if receive is not None:
                receive(sender, frame)


@dataclass(slots=True)
class _Call:
    """A call that waits for its answer; `last_frame` is the loop time of the last frame about it, or of its start."""

    answer: asyncio.Future[Any]
    last_frame: float


@dataclass(slots=True)
class _Peer:
    """State about one sender, from the sender's start to its end; a restarted sender is another peer.

    Attributes:
        answers: encoded answers by the call's number; `None` while the call runs.
        newest: the number of the newest push of each kind.
        forgotten: answers to calls with smaller numbers are dropped.
        at: loop time of the sender's last frame, in seconds.
    """

    answers: dict[int, bytes | None] = field(default_factory=dict)
    newest: dict[str, int] = field(default_factory=dict)
    forgotten: int = 0
    at: float = 0.0


class Endpoint:
    """One address on a transport; use it only in the loop's own thread.

    Attributes:
        address: the name for other endpoints.
        life: identifier that distinguishes this endpoint from earlier ones at the address.
        dropped: number of dropped frames, by reason.

    Args:
        address: the name for other endpoints.
        transport: carries the frames.
        life: the identifier; random by default.
    """

    def __init__(self, address: str, transport: Transport, life: str | None = None) -> None:
        self.address = address
        self._transport = transport
        self.life = life or secrets.token_hex(6)
        self._answering: dict[str, Answers] = {}
        self._hearing: dict[str, FrameReceiver] = {}
        self._asked: dict[int, _Call] = {}
        self._peers: dict[tuple[str, str], _Peer] = {}  # by address and life
        self._lives: dict[str, str] = {}  # the present life of each address
        self.dropped: Counter[str] = Counter()
        self._last = 0
        self._running: set[asyncio.Task[None]] = set()
        transport.attach(address, self._receive)

    def answer(self, kind: str, answers: Answers) -> None:
        """Answer calls of that kind with `answers`; a repeated call is executed only one time."""
        self._answering[kind] = answers

    def receive(self, kind: str, receiver: FrameReceiver) -> None:
        """Pass pushes of that kind to `receiver`, except those older than the sender's newest push."""
        self._hearing[kind] = receiver

    def deafen(self, kind: str) -> None:
        """Stop handling pushes of that kind."""
        self._hearing.pop(kind, None)
        for peer in self._peers.values():
            peer.newest.pop(kind, None)

    async def call(self, to: str, kind: str, body: Any = None, within: float = WITHIN) -> Any:
        """Send a call to the address, and return its answer.

        Raises:
            NoAnswerError: nothing has arrived for `within` seconds; the call may have been executed.
            RefusedError: the other endpoint could not execute the call.
            ProgrammingError: code at the other endpoint failed, which has logged the traceback.
            InputError: the body is not plain data.
        """
        number = self._last = self._last + 1
        loop = asyncio.get_running_loop()
        call = self._asked[number] = _Call(loop.create_future(), loop.time())
        try:
            while not call.answer.done():
                left = call.last_frame + within - loop.time()
                if left <= RESOLUTION:
                    raise NoAnswerError(f"'{to}' has not answered '{kind}' within {within:g} s")
                self._send(to, "call", kind, number, body)
                await asyncio.wait([call.answer], timeout=min(AGAIN, left))
            return call.answer.result()
        finally:
            del self._asked[number]

    def push(self, to: str, kind: str, body: Any) -> None:
        """Send a push, which may be lost, to an address; raise `InputError` if the body is not plain data."""
        self._last += 1
        self._send(to, "push", kind, self._last, body)

    def broadcast(self, kind: str, body: Any) -> None:
        """Send a push to `BROADCAST`."""
        self.push(BROADCAST, kind, body)

    def watch(self, address: str, changed: PresenceChanged) -> Callable[[], None]:
        """Report the presence of another address, as `Transport.watch`."""
        return self._transport.watch(address, changed)

    async def close(self) -> None:
        """Detach from the address, and cancel running calls."""
        self._transport.detach(self.address)
        for task in self._running:
            task.cancel()
        if self._running:
            await asyncio.wait(tuple(self._running))

    # -- frames ------------------------------------------------------------------------------------------

    def _send(self, to: str, what: str, kind: str, number: int, body: Any) -> None:
        # The receiver may forget answers to calls before `low`: this endpoint no longer waits for them.
        low = min(self._asked, default=number)
        content = {"what": what, "kind": kind, "n": number, "low": low, "life": self.life, "body": body}
        self._transport.send(self.address, to, _frame_of(content))

    def _receive(self, sender: str, frame: bytes) -> None:
        if len(frame) > MOST_BYTES:
            self.dropped["too long"] += 1
            return
        said = _frame(frame)
        if said is None:
            self.dropped["no frame"] += 1
        elif said["what"] in _TO_CALLER:
            if said["life"] == self.life:
                self._answer(said)
        elif (peer := self._peer(sender, said["life"])) is None:
            self.dropped["too many peers"] += 1
        elif said["what"] == "call":
            self._call(sender, peer, said)
        else:
            self._received(sender, peer, said)

    def _peer(self, sender: str, life: str) -> _Peer | None:
        """Return the peer that sent a frame; `None` if the peer is new and the endpoint remembers too many."""
        now, peer = asyncio.get_running_loop().time(), self._peers.get((sender, life))
        if peer is None:
            if len(self._peers) >= MOST_PEERS:
                self._forget_silent(now)
                if len(self._peers) >= MOST_PEERS:
                    return None
            peer = self._peers[sender, life] = _Peer()
            self._lives[sender] = life
        peer.at = now
        return peer

    def _forget_silent(self, now: float) -> None:
        for (address, life), peer in list(self._peers.items()):
            if now - peer.at > REMEMBERED and None not in peer.answers.values():
                del self._peers[address, life]
                if self._lives.get(address) == life:
                    del self._lives[address]

    def _received(self, sender: str, peer: _Peer, said: Mapping[str, Any]) -> None:
        kind, number = said["kind"], said["n"]
        if kind in self._hearing and self._lives.get(sender) == said["life"] and number > peer.newest.get(kind, 0):
            peer.newest[kind] = number
            try:
                with contained():
                    self._hearing[kind](sender, said["body"])
            except Exception:  # noqa: BLE001  # a faulty push must not stop other pushes
                self.dropped[f"push '{kind}' that cannot be read"] += 1

    def _answer(self, said: Mapping[str, Any]) -> None:
        call = self._asked.get(said["n"])
        if call is None or call.answer.done():
            return
        call.last_frame, waiting = asyncio.get_running_loop().time(), call.answer
        if said["what"] == "running":
            return
        if said["what"] == "answer":
            waiting.set_result(said["body"])
        elif said["what"] == "bug":
            waiting.set_exception(ProgrammingError(text_of(said["body"], str)))
        else:
            waiting.set_exception(RefusedError(text_of(said["body"], str)))

    def _call(self, sender: str, peer: _Peer, said: Mapping[str, Any]) -> None:
        number = said["n"]
        if said["low"] > peer.forgotten:
            peer.forgotten = said["low"]
            peer.answers = {n: answer for n, answer in peer.answers.items() if n >= peer.forgotten}
        if number < peer.forgotten:
            return  # a late duplicate: the caller no longer waits for an answer
        if number in peer.answers:
            again = peer.answers[number]
            if again is None:
                again = encoded({"what": "running", "n": number, "life": said["life"], "body": None})
            self._transport.send(self.address, sender, again)
            return
        if len(peer.answers) >= MOST_CALLS:
            self.dropped["too many calls"] += 1
            return
        peer.answers[number] = None
        task = asyncio.get_running_loop().create_task(self._execute(sender, peer, said))
        self._running.add(task)
        task.add_done_callback(self._running.discard)

    async def _execute(self, sender: str, peer: _Peer, said: Mapping[str, Any]) -> None:
        frame = await self._answer_to(sender, said)
        if said["n"] >= peer.forgotten:
            peer.answers[said["n"]] = frame
        self._transport.send(self.address, sender, frame)

    async def _answer_to(self, sender: str, said: Mapping[str, Any]) -> bytes:
        """Execute a call, and return the frame of its answer."""

        def frame(what: str, body: Any) -> bytes:
            return _frame_of({"what": what, "n": said["n"], "life": said["life"], "body": body})

        answers = self._answering.get(said["kind"])
        if answers is None:
            return frame("refusal", f"'{self.address}' does not answer '{said['kind']}'")
        try:
            with contained():
                body = await answers(sender, said["body"])
            return frame("answer", body)
        except ProgrammingError as error:
            return frame("bug", str(error))
        except Exception as error:  # noqa: BLE001  # any error reaches the caller as text
            return frame("refusal", reason_of(error))


_TO_CALLER = frozenset({"answer", "refusal", "bug", "running"})
"""Kinds of the frames that an endpoint receives about its calls."""


def _frame_of(content: Mapping[str, Any]) -> bytes:
    """Return a frame; raise `InputError` if the content is not plain data, or longer than `MOST_BYTES`."""
    frame = encoded(content)
    if len(frame) > MOST_BYTES:
        raise InputError(f"a message has at most {MOST_BYTES} bytes, not {len(frame)}; send a file's name, or parts")
    return frame


def _frame(frame: bytes) -> dict[str, Any] | None:
    """Return the content of a frame; `None` if no endpoint can have sent the frame."""
    try:
        said = json.loads(frame)
    except (ValueError, TypeError, RecursionError):
        return None
    if not (isinstance(said, dict) and {"what", "n", "life", "body"} <= said.keys()):
        return None
    if not (type(said["n"]) is int and isinstance(said["life"], str) and len(said["life"]) <= _LONGEST):
        return None
    match said:
        case {"what": str(what)} if what in _TO_CALLER:
            return said
        case {"what": "call" | "push", "kind": str(kind), "low": int(low)}:
            return said if len(kind) <= _LONGEST and low <= said["n"] else None
        case _:
            return None
