"""One address on a transport: calls that are carried out at most once, and pushes of which the newest counts.

A call is sent again until it is answered, and whoever carries it out remembers its answer until the caller has it. So
every pattern that wants an answer (query, param, state, send, event) survives loss, doubles and reordering; what
cannot be helped is that nobody answers in time. Pushes are sent once; one that was overtaken is dropped.
"""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.components.transport import EVERYBODY, Transport
from knowledge_base.errors import InputError

Answers = Callable[[str, Any], Awaitable[Any]]
"""What answers a call: is given the sender's address and the body."""
Hears = Callable[[str, Any], None]
"""What hears a push: likewise."""
WITHIN = 5.0
"""Seconds for a call if nobody says otherwise."""
AGAIN = 0.2
"""Seconds after which an unanswered call is sent again."""


class NoAnswerError(Exception):
    """Nobody has answered in time: the other side is gone, late, or cannot be reached."""


class RefusedError(Exception):
    """The other side has answered that it could not do it, and why."""


def encoded(value: Any) -> bytes:
    """Plain data as a frame; raises `InputError` for what is no plain data."""
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"only plain data can be sent: {error}") from None


@dataclass(slots=True)
class _Peer:
    """What is known of one life of one sender."""

    answers: dict[int, bytes | None] = field(default_factory=dict)
    newest: dict[str, int] = field(default_factory=dict)
    forgotten: int = 0


class Endpoint:
    """One address on a transport; for the loop's own thread.

    Attributes:
        address: how others reach it.
        life: tells it from an earlier one at the address.

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
        self._peers: dict[str, dict[str, _Peer]] = {}  # by address and life; the last life is the present one
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
        for lives in self._peers.values():
            for peer in lives.values():
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
        said = json.loads(frame)
        if said["what"] == "call":
            self._carry_out(sender, said)
        elif said["what"] == "push":
            self._heard(sender, said)
        elif said["life"] == self.life:
            self._answered(said)

    def _peer(self, sender: str, said: Mapping[str, Any]) -> _Peer:
        return self._peers.setdefault(sender, {}).setdefault(said["life"], _Peer())

    def _heard(self, sender: str, said: Mapping[str, Any]) -> None:
        newest = self._peer(sender, said).newest
        present = next(reversed(self._peers[sender])) == said["life"]
        if present and said["kind"] in self._hearing and said["n"] > newest.get(said["kind"], 0):
            newest[said["kind"]] = said["n"]
            self._hearing[said["kind"]](sender, said["body"])

    def _answered(self, said: Mapping[str, Any]) -> None:
        waiting = self._asked.get(said["n"])
        if waiting is None or waiting.done():
            return
        if said["what"] == "answer":
            waiting.set_result(said["body"])
        else:
            waiting.set_exception(RefusedError(said["body"]))

    def _carry_out(self, sender: str, said: Mapping[str, Any]) -> None:
        peer, number = self._peer(sender, said), said["n"]
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
            body = await answers(sender, said["body"])
            encoded(body)
        except InputError as error:
            return "refusal", str(error)
        except Exception as error:  # noqa: BLE001  # whatever it is, the caller is told
            return "refusal", f"{type(error).__name__}: {error}"
        return "answer", body
