"""Calls in a process and between processes, and Zenoh alone; times until a death is noticed; see docs/speed.md.

`python benchmarks/wire.py [--quick] [--json] [--write]`: a moment for each, plain data for programs, or the tables for
docs/speed.md.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import platform
import random
import signal
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import page
from rows import Cell, Row, Target, table
from timing import Figures, Job, Pace, measure, ratio
from wire_peer import SERVER, BareClient, echo

from dsc.wire import Endpoint, LocalTransport, ZenohTransport

FULL, QUICK = Pace(rounds=9, seconds=0.3), Pace(rounds=1, seconds=0.05)
LOCAL, WIRE, PUT, QUERY = "in a process", "over Zenoh", "bare put and put", "bare query and reply"
COLUMNS = [LOCAL, WIRE, PUT, QUERY]
BODIES = {"a small body": {"to": "kitchen", "speed": 0.5}, "a body of 10 kB": {"scan": [0.125] * 1600}}
MOST = 2.0
"""Maximum ratio of a call to a bare round trip."""


def free_endpoint() -> str:
    while True:
        port = random.randint(20000, 32000)  # noqa: S311  # below the ports that the system gives to other sockets
        with suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return f"tcp/127.0.0.1:{port}"


@contextmanager
def peer(*endpoints: str) -> Iterator[subprocess.Popen[str]]:
    """Start the other process; kill it at the end of the block."""
    command = [sys.executable, str(Path(__file__).with_name("wire_peer.py")), *endpoints]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            process.kill()


def calling(loop: asyncio.AbstractEventLoop, client: Endpoint, body: Any) -> Job:
    """Return a job of calls, one after the other."""

    async def call(times: int) -> None:
        for _ in range(times):
            assert await client.call(SERVER, "echo", body) is not None

    return Job(lambda times: loop.run_until_complete(call(times)))


def bare(round_trip: Any, body: Any) -> Job:
    """Return a job of round trips, one after the other."""

    def run(times: int) -> None:
        for _ in range(times):
            assert round_trip(body) is not None

    return Job(run)


def calls(pace: Pace) -> list[Row]:
    """Return a row for each body."""
    endpoint, bare_endpoint = free_endpoint(), free_endpoint()
    loop = asyncio.new_event_loop()
    with ExitStack() as stack:
        stack.callback(loop.close)
        stack.enter_context(peer(endpoint, bare_endpoint))
        near, far = LocalTransport(), stack.enter_context(ZenohTransport(connect=[endpoint]))
        client = BareClient(bare_endpoint)
        stack.callback(client.close)

        async def attached() -> tuple[Endpoint, Endpoint]:
            Endpoint(SERVER, near).answer("echo", echo)
            return Endpoint("client", near), Endpoint("client", far)

        here, there = loop.run_until_complete(attached())
        rows = []
        for name, body in BODIES.items():
            jobs = {
                LOCAL: calling(loop, here, body), WIRE: calling(loop, there, body),
                PUT: bare(client.put, body), QUERY: bare(client.query, body),
            }  # fmt: skip
            rows.append(row(f"a call with {name}", measure(jobs, pace)))
        return rows


def row(case: str, figures: Figures) -> Row:
    cells = {name: Cell(1e6 * statistics.median(rounds)) for name, rounds in figures.items()}
    targets = [Target(f"x {name}", MOST, ratio(figures, WIRE, name)) for name in (QUERY, PUT)]
    return Row(case, "µs", cells, targets=targets)


async def noticed(number: signal.Signals) -> float:
    """Return the seconds from a signal to the other process until its address is reported as gone."""
    endpoint, gone, there = free_endpoint(), asyncio.Event(), asyncio.Event()
    with peer(endpoint, free_endpoint()) as process, ZenohTransport(connect=[endpoint]) as transport:
        transport.watch(SERVER, lambda present: (there if present else gone).set())
        await asyncio.wait_for(there.wait(), 10)
        began = time.perf_counter()
        process.send_signal(number)
        await asyncio.wait_for(gone.wait(), 10)
        return time.perf_counter() - began


def notices(rounds: int) -> list[Row]:
    """Return a row for a killed process and for a stopped one."""
    rows = []
    for case, number, most in [("SIGKILL", signal.SIGKILL, 100.0), ("SIGSTOP", signal.SIGSTOP, 3000.0)]:
        seconds = [asyncio.run(noticed(number)) for _ in range(rounds)]
        figures = {"median": 1000 * statistics.median(seconds), "longest": 1000 * max(seconds)}
        cells = {name: Cell(value) for name, value in figures.items()}
        rows.append(Row(f"{case} noticed", "ms", cells, targets=[Target(" ms", most, figures["longest"])]))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a moment for each, to see that it works")
    parser.add_argument("--json", action="store_true", help="plain data")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/speed.md")
    options = parser.parse_args()
    pace = QUICK if options.quick else FULL
    round_trips, deaths = calls(pace), notices(1 if options.quick else 5)
    if options.json:
        print(json.dumps({"rows": [one.to_json() for one in (*round_trips, *deaths)]}))
        return
    said = f"Measured with Python {platform.python_version()} and eclipse-zenoh {version('eclipse-zenoh')}."
    text = f"{table(round_trips, COLUMNS)}\n\n{table(deaths, ['median', 'longest'])}\n\n{said}"
    print(text)
    if options.write:
        page.put(text, "wire")


if __name__ == "__main__":
    main()
