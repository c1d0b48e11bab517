"""The other process of `benchmarks/wire.py`: answers calls, queries and puts with their own body.

`python benchmarks/wire_peer.py ENDPOINT`. `BareClient` is the hand-written client that the calls are compared with.
"""

from __future__ import annotations

import asyncio
import json
import queue
import sys
from typing import Any

import zenoh

from dsc.components.frames import encoded
from dsc.wire import Endpoint, ZenohTransport

SERVER = "server"
TRIES = 20
"""Attempts of a round trip; the first ones may be lost."""
THERE, BACK, QUERY = "bare/there", "bare/back", "bare/query"


async def echo(_: str, body: Any) -> Any:
    """Return the body of a call."""
    return body


def session(**endpoints: str) -> zenoh.Session:
    """Return a session on this machine, which listens or connects."""
    config = zenoh.Config()
    for key, value in {"listen": "tcp/127.0.0.1:0", **endpoints}.items():
        config.insert_json5(f"{key}/endpoints", json.dumps([value]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


class BareClient:
    """Round trips by the library alone, with a number and with JSON as the calls have them; answers come in order."""

    def __init__(self, endpoint: str) -> None:
        self._session = session(connect=endpoint)
        self._answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._session.declare_subscriber(BACK, lambda sample: self._answers.put(sample.payload.to_bytes()))
        self._querier = self._session.declare_querier(QUERY)
        self._publisher = self._session.declare_publisher(THERE)
        self._number = 0

    def put(self, body: Any) -> Any:
        """Return the body of a put that the peer answers with a put; the first puts may be lost."""
        self._number += 1
        for _ in range(TRIES):
            self._publisher.put(encoded({"n": self._number, "body": body}))
            try:
                return json.loads(self._answers.get(timeout=0.2))["body"]
            except queue.Empty:
                continue
        raise TimeoutError("the peer answers no put")

    def query(self, body: Any) -> Any:
        """Return the body of a query that the peer answers with a reply."""
        self._number += 1
        for _ in range(TRIES):
            for reply in self._querier.get(payload=encoded({"n": self._number, "body": body})):
                if reply.ok is not None:
                    return json.loads(reply.ok.payload.to_bytes())["body"]
        raise TimeoutError("the peer answers no query")

    def close(self) -> None:
        """Close the session."""
        self._session.close()  # type: ignore[no-untyped-call]


def answer_bare(bare: zenoh.Session) -> None:
    """Answer puts with puts, and queries with replies."""
    publisher = bare.declare_publisher(BACK)

    def answer_query(query: zenoh.Query) -> None:
        with query:
            assert query.payload is not None
            query.reply(QUERY, encoded(json.loads(query.payload.to_bytes())))

    bare.declare_subscriber(THERE, lambda sample: publisher.put(encoded(json.loads(sample.payload.to_bytes()))))
    bare.declare_queryable(QUERY, answer_query)


async def serve(endpoint: str, bare_endpoint: str) -> None:
    """Answer until the process ends."""
    with session(listen=bare_endpoint) as bare, ZenohTransport(listen=[endpoint]) as transport:
        answer_bare(bare)
        Endpoint(SERVER, transport).answer("echo", echo)
        print("ready", flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(serve(*sys.argv[1:]))
