"""Simulated time stands still while a skill waits for a socket, a pipe or a process of its component."""

from __future__ import annotations

import asyncio
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from dsc_runs import Ran

from dsc import Component, Outcome, SkillCall, skill

ASK = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      a: {entry: {trigger: arm.SKILL, within: WITHIN}, on: {ok: b, timed_out: e, skill_error: e}}
      b: {entry: {assign: {n: (+ ?n 1)}}, always: [{to: a, when: (< ?n 3)}, {to: e}]}
      e: {final: true}
"""
SLOW = 0.15
"""Real seconds until the server answers."""


class Slow(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        self.server.asked += 1  # type: ignore[attr-defined]
        time.sleep(SLOW)
        self.send_response(200)
        self.send_header("Content-Length", "2")
        self.end_headers()
        self.wfile.write(b"ok")

    def log_message(self, *_: object) -> None:
        """Print nothing."""


@pytest.fixture
def server() -> Iterator[ThreadingHTTPServer]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Slow)
    server.daemon_threads = True
    server.asked = 0  # type: ignore[attr-defined]
    serving = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    serving.start()
    yield server
    server.shutdown()
    serving.join()
    server.server_close()


class Ok(Outcome): ...


class Web(Component):
    """Asks a server, over one connection that stays open."""

    name = "arm"

    def __init__(self, port: int = 0, *, at_start: bool = False) -> None:
        super().__init__()
        self.port = port
        self.at_start = at_start
        self.connection: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def start(self) -> None:
        if self.at_start:
            await self.get()

    async def stop(self) -> None:
        if self.connection is not None:
            self.connection[1].close()

    async def get(self) -> None:
        if self.connection is None:
            self.connection = await asyncio.open_connection("127.0.0.1", self.port)
        reader, writer = self.connection
        writer.write(b"GET / HTTP/1.1\r\nHost: here\r\n\r\n")
        await reader.readuntil(b"\r\n\r\n")
        assert await reader.readexactly(2) == b"ok"

    @skill
    async def ask(self, call: SkillCall) -> Ok:
        async with asyncio.timeout(60):
            await self.get()
        return Ok()

    @skill
    async def ask_beside(self, call: SkillCall) -> Ok:
        await asyncio.gather(self.get(), call.clock.sleep(0.01))
        return Ok()

    @skill
    async def ask_and_rest(self, call: SkillCall) -> Ok:
        await self.get()
        await call.clock.sleep(1000)
        return Ok()

    @skill
    async def run(self, call: SkillCall) -> Ok:
        process = await asyncio.create_subprocess_exec(sys.executable, "-S", "-c", f"import time; time.sleep({SLOW})")
        await process.wait()
        return Ok()

    @skill
    async def read(self, call: SkillCall) -> Ok:
        code = f"import time; time.sleep({SLOW}); print('ok')"
        process = await asyncio.create_subprocess_shell(
            f'{sys.executable} -S -c "{code}"', stdout=asyncio.subprocess.PIPE
        )
        out, _ = await process.communicate()
        assert out == b"ok\n"
        return Ok()


def ran(arm: Web, name: str, within: float = 20.0) -> Ran:
    return Ran(ASK.replace("SKILL", name).replace("WITHIN", f"{within:g}"), arm=arm)


@pytest.mark.parametrize(("name", "at"), [("ask", 0.0), ("ask_beside", 0.03), ("ask_and_rest", 3000.0)])
def test_each_request_is_sent_one_time_and_answered(server: ThreadingHTTPServer, name: str, at: float) -> None:
    run = ran(Web(server.server_port), name, 2000)
    assert (run.end.reached, server.asked) == (True, 3)  # type: ignore[attr-defined]
    assert run.at == pytest.approx(at)


def test_a_hook_that_waits_for_a_socket_has_the_time_it_needs(server: ThreadingHTTPServer) -> None:
    run = ran(Web(server.server_port, at_start=True), "ask")
    assert (run.end.reached, server.asked, run.at) == (True, 4, 0)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", ["run", "read"])
def test_a_process_has_the_time_it_needs(name: str) -> None:
    run = ran(Web(), name)
    assert (run.end.reached, run.at) == (True, 0)


def test_a_deadline_counts_the_real_seconds_of_the_wait(server: ThreadingHTTPServer) -> None:
    began = time.monotonic()
    run = ran(Web(server.server_port), "ask", SLOW / 3)
    assert [one.data["name"] for one in run.records if one.type == "event"] == ["timed_out"]
    assert run.at == pytest.approx(SLOW / 3)
    assert time.monotonic() - began >= SLOW / 3
