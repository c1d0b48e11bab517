"""One address on a transport: calls that are carried out at most once, and pushes of which the newest counts.

A call is sent again until it is answered, and whoever carries it out remembers its answer until the caller has it. So
every pattern that wants an answer (query, param, state, send, event) survives loss, doubles and reordering; what
cannot be helped is that nobody answers in time. Pushes are sent once; one that was overtaken is dropped.

Any bytes may arrive. A frame that is none of ours, or that there is no room for, is dropped and counted; a caller
sends its frame again. A peer keeps its place until it has been silent for `REMEMBERED` seconds, so that a flood from
new addresses makes nothing be carried out twice.
"""

from __future__ import annotations

import asyncio
import json
import secrets
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from dsc.components.hooks import contained
from knowledge_base.errors import InputError, described, text_of

Answers = Callable[[str, Any], Awaitable[Any]]
"""What answers a call: is given the sender's address and the body."""
Hears = Callable[[str, Any], None]
"""What hears a push: likewise."""
WITHIN = 5.0
"""Seconds for a call if nobody says otherwise."""
AGAIN = 0.2
"""Seconds after which an unanswered call is sent again."""
MOST_PEERS = 1_000
"""Lives of senders of which anything is known."""
REMEMBERED = 60.0
"""Seconds of silence after which a sender may be forgotten if there are `MOST_PEERS`."""
MOST_CALLS = 1_000
"""Calls of one sender that are being carried out, or whose answer it may still ask for."""


class NoAnswerError(Exception):
    """Nobody has answered in time: the other side is gone, late, or cannot be reached."""


class RefusedError(Exception):
    """The other side has answered that it could not do it, and why."""


def encoded(value: Any) -> bytes:
    """Plain data as a frame; raises `InputError` for what is no plain data."""
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"only plain data can be sent: {described(error, named=False)}") from None


@dataclass(slots=True)
class _Peer:
    """What is known of one life of one sender."""

    answers: dict[int, bytes | None] = field(default_factory=dict)
    newest: dict[str, int] = field(default_factory=dict)
    forgotten: int = 0
    at: float = 0.0

    @property
    def at_work(self) -> bool:
        """Whether a call of it is being carried out."""
        return None in self.answers.values()


class Endpoint:
    """One address on a transport; for the loop's own thread.

    Attributes:
        address: how others reach it.
        life: tells it from an earlier one at the address.
        dropped: how many frames were dropped, by reason.

    Args:
        address: how others reach it.
        transport: what carries its frames.
        life: made up if left out.
    """

    def __init__(self, address: str, transport: Transport, life: str | None = None) -> None:
        self.address = address
        self._transport = transport
        self.life = life or secrets.token_hex(6)
        self._answering: dict[str, Answers] = {}
        self._hearing: dict[str, Hears] = {}
        self._asked: dict[int, asyncio.Future[Any]] = {}
        self._peers: dict[tuple[str, str], _Peer] = {}  # by address and life
        self._lives: dict[str, str] = {}  # the present life of each address
        self.dropped: Counter[str] = Counter()
        self._last = 0
        self._working: set[asyncio.Task[None]] = set()
        transport.attach(address, self._receive)

    def answer(self, kind: str, answers: Answers) -> None:
        """Carry out calls of that kind: each at most once, even if it is sent again."""
        self._answering[kind] = answers

    def hear(self, kind: str, hears: Hears) -> None:
        """Hear pushes of that kind, none older than the last one from the same sender."""
        self._hearing[kind] = hears

    def deafen(self, kind: str) -> None:
        """Hear pushes of that kind no more."""
        self._hearing.pop(kind, None)
        for peer in self._peers.values():
            peer.newest.pop(kind, None)

    async def call(self, to: str, kind: str, body: Any = None, within: float = WITHIN) -> Any:
        """Ask the address, and wait for its answer.

        Raises:
            NoAnswerError: nobody has answered within so many seconds. It may have been carried out all the same.
            RefusedError: the other side could not do it.
            InputError: the body is no plain data.
        """
        number = self._last = self._last + 1
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._asked[number] = answer
        try:
            async with asyncio.timeout(within):
                while not answer.done():
                    self._send(to, "call", kind, number, body)
                    await asyncio.wait([answer], timeout=AGAIN)
                return answer.result()
        except TimeoutError:
            raise NoAnswerError(f"'{to}' has not answered '{kind}' within {within:g} s") from None
        finally:
            del self._asked[number]

    def push(self, to: str, kind: str, body: Any) -> None:
        """Tell an address, or `EVERYBODY`, something; it may be lost. Raises `InputError` if it is no plain data."""
        self._last += 1
        self._send(to, "push", kind, self._last, body)

    def broadcast(self, kind: str, body: Any) -> None:
        """Push to everybody."""
        self.push(EVERYBODY, kind, body)

    async def close(self) -> None:
        """Answer no more; what is being carried out is cancelled."""
        self._transport.detach(self.address)
        for task in self._working:
            task.cancel()
        if self._working:
            await asyncio.wait(tuple(self._working))

    # -- frames ------------------------------------------------------------------------------------------

    def _send(self, to: str, what: str, kind: str, number: int, body: Any) -> None:
        # Answers to calls before `low` need not be kept: nobody waits for them any more.
        low = min(self._asked, default=number)
        frame = {"what": what, "kind": kind, "n": number, "low": low, "life": self.life, "body": body}
        self._transport.send(self.address, to, encoded(frame))

    def _receive(self, sender: str, frame: bytes) -> None:
        said = _frame(frame)
        if said is None:
            self.dropped["no frame"] += 1
        elif said["what"] in {"answer", "refusal"}:
            if said["life"] == self.life:
                self._answered(said)
        elif (peer := self._peer(sender, said["life"])) is None:
            self.dropped["too many peers"] += 1
        elif said["what"] == "call":
            self._carry_out(sender, peer, said)
        else:
            self._heard(sender, peer, said)

    def _peer(self, sender: str, life: str) -> _Peer | None:
        """What is known of the sender; `None` if it is new and there is no room."""
        now, peer = asyncio.get_running_loop().time(), self._peers.get((sender, life))
        if peer is None:
            if len(self._peers) >= MOST_PEERS and not self._forget_silent(now):
                return None
            peer = self._peers[sender, life] = _Peer()
            self._lives[sender] = life
        peer.at = now
        return peer

    def _forget_silent(self, now: float) -> bool:
        """Forget who has been silent for long; whether that was anybody."""
        silent = [key for key, peer in self._peers.items() if now - peer.at > REMEMBERED and not peer.at_work]
        for address, life in silent:
            del self._peers[address, life]
            if self._lives.get(address) == life:
                del self._lives[address]
        return bool(silent)

    def _heard(self, sender: str, peer: _Peer, said: Mapping[str, Any]) -> None:
        kind, number = said["kind"], said["n"]
        if kind in self._hearing and self._lives.get(sender) == said["life"] and number > peer.newest.get(kind, 0):
            peer.newest[kind] = number
            try:
                with contained():
                    self._hearing[kind](sender, said["body"])
            except Exception:  # noqa: BLE001  # whatever was pushed, the others are heard
                self.dropped[f"push '{kind}' that nobody could take"] += 1

    def _answered(self, said: Mapping[str, Any]) -> None:
        waiting = self._asked.get(said["n"])
        if waiting is None or waiting.done():
            return
        if said["what"] == "answer":
            waiting.set_result(said["body"])
        else:
            waiting.set_exception(RefusedError(text_of(said["body"], str)))

    def _carry_out(self, sender: str, peer: _Peer, said: Mapping[str, Any]) -> None:
        number = said["n"]
        if said["low"] > peer.forgotten:
            peer.forgotten = said["low"]
            peer.answers = {n: answer for n, answer in peer.answers.items() if n >= peer.forgotten}
        if number < peer.forgotten:
            return  # a late double: the caller has its answer, or waits no more
        if number in peer.answers:
            again = peer.answers[number]
            if again is not None:
                self._transport.send(self.address, sender, again)
            return
        if len(peer.answers) >= MOST_CALLS:
            self.dropped["too many calls"] += 1
            return
        peer.answers[number] = None
        task = asyncio.get_running_loop().create_task(self._work(sender, peer, said))
        self._working.add(task)
        task.add_done_callback(self._working.discard)

    async def _work(self, sender: str, peer: _Peer, said: Mapping[str, Any]) -> None:
        what, body = await self._answer_to(sender, said)
        frame = encoded({"what": what, "n": said["n"], "life": said["life"], "body": body})
        if said["n"] >= peer.forgotten:
            peer.answers[said["n"]] = frame
        self._transport.send(self.address, sender, frame)

    async def _answer_to(self, sender: str, said: Mapping[str, Any]) -> tuple[str, Any]:
        answers = self._answering.get(said["kind"])
        if answers is None:
            return "refusal", f"'{self.address}' does not answer '{said['kind']}'"
        try:
            with contained():
                body = await answers(sender, said["body"])
            encoded(body)
        except Exception as error:  # noqa: BLE001  # whatever it is, the caller is told
            return "refusal", described(error, named=not isinstance(error, InputError))
        return "answer", body


def _frame(frame: bytes) -> dict[str, Any] | None:
    """What a frame says; `None` if it is none that an endpoint sends."""
    try:
        said = json.loads(frame)
    except (ValueError, TypeError, RecursionError):
        return None
    if not (isinstance(said, dict) and {"what", "n", "life", "body"} <= said.keys()):
        return None
    if not (type(said["n"]) is int and isinstance(said["life"], str) and len(said["life"]) <= _LONGEST):
        return None
    match said:
        case {"what": "answer" | "refusal"}:
            return said
        case {"what": "call" | "push", "kind": str(kind), "low": int(low)}:
            return said if len(kind) <= _LONGEST and low <= said["n"] else None
    return None


_LONGEST = 1_000
"""Characters of the name of a kind or a life."""


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
