"""What the page costs: its weight, its layouts, a run that is watched, a long run opened (`make bench-viewer`).

Runs are measured with nobody, 1 and 8 browsers attached, in turn, each browser a process that takes in all records;
what counts is the ratio to the same runs without a page: of the time they take (median of the rounds), and of the
computing time of their own process, in which the page is served too (the least of all rounds, since what else the
machine does only adds to it). All plans are known before, so that nothing but the run is measured. Eight
processes that read at the same time on two cores slow the run besides; that is in the first ratio and not in the
second. Layouts and pages are measured by `frontend/bench.mjs`.
"""

from __future__ import annotations

import argparse
import gzip
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from websockets.sync.client import connect

from domains.clean_up_table.deployment import deploy
from domains.clean_up_table.scenario import Scenario
from dsc.trace import header, write_to
from dsc.viewer.records import RecordLog
from dsc.viewer.server import STATIC, Viewer
from planning import Planner
from planning.engines.cache import CachingPlanner
from planning.engines.planner import PlannerProcess

FRONTEND = Path(__file__).parent.parent / "frontend"
WATCHED = {"no page": None, "nobody looks": 0, "1 browser": 1, "8 browsers": 8}
SCENARIO = "table: {cups: 4, cans: 3, crisp_cans: [small, large]}"
RECORDS = 100_000
RUNS = 4
"""One after the other, with faults: one alone is too short to be measured."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="runs with each number of browsers")
    parser.add_argument("--client", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.client:
        watch(chosen.client)
        return
    print_weight()
    print_watched(chosen.rounds)
    for count, milliseconds in node("layout").items():
        print(f"layout of {count:>4} states   {milliseconds:7.0f} ms")
    print_opened()


def print_weight() -> None:
    """Bytes that a browser fetches, compressed, without and with the worker that lays out."""
    sizes = {path.name: len(gzip.compress(path.read_bytes())) for path in STATIC.rglob("*") if path.suffix in _FETCHED}
    worker = sizes.pop("elk-worker.min.js")
    print(f"page {sum(sizes.values()) / 1000:.0f} kB compressed, worker for layouts {worker / 1000:.0f} kB")


_FETCHED = {".html", ".js", ".css", ".svg"}


def print_watched(rounds: int) -> None:
    """How much longer runs take when they are watched; who begins changes from round to round."""
    figures: dict[str, list[Taken]] = {name: [] for name in WATCHED}
    process = PlannerProcess()
    planner = CachingPlanner(process)
    runs_watched(None, planner)  # all plans are known from here on
    for number in range(rounds):
        names = list(WATCHED)[number % len(WATCHED) :] + list(WATCHED)[: number % len(WATCHED)]
        for name in names:
            figures[name].append(runs_watched(WATCHED[name], planner))
    process.kill()
    bare = figures["no page"]
    for name, taken in figures.items():
        wall = statistics.median(one.wall / other.wall for one, other in zip(taken, bare, strict=True))
        seconds = statistics.median(one.wall for one in taken)
        computed = min(one.cpu for one in taken)
        cpu = computed / min(one.cpu for one in bare)
        print(f"{RUNS} runs, {name:<12} {seconds:6.2f} s {wall:5.2f} x, computing {computed:5.2f} s {cpu:5.2f} x")


class Taken(NamedTuple):
    """Seconds: by the clock on the wall, and of computing in this process, all threads."""

    wall: float
    cpu: float


def runs_watched(browsers: int | None, planner: Planner) -> Taken:
    """What runs with so many browsers take; `None` browsers are runs without a page and without records."""
    log = RecordLog(header(), live=True)
    wall, cpu = 0.0, 0.0
    with ExitStack() as stack:
        if browsers is not None:
            viewer = stack.enter_context(serving(log))
            stack.enter_context(watching(viewer, browsers))
        for seed in range(RUNS):
            table = deploy(Scenario.parse(SCENARIO), seed, 0.2, planner, None if browsers is None else log.hear)
            with table.executive:
                started, computed = time.perf_counter(), time.process_time()
                table.run()
                wall, cpu = wall + time.perf_counter() - started, cpu + time.process_time() - computed
        log.end()
    return Taken(wall, cpu)


@contextmanager
def serving(log: RecordLog) -> Iterator[Viewer]:
    viewer = Viewer(log)
    viewer.start()
    try:
        yield viewer
    finally:
        viewer.close()


@contextmanager
def watching(viewer: Viewer, count: int) -> Iterator[None]:
    """So many processes attached, each of which has said that it is."""
    command = [sys.executable, __file__, "--client", f"{viewer.port} {viewer.token}"]
    clients = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(count)]
    try:
        for client in clients:
            assert client.stdout is not None
            assert client.stdout.readline() == "attached\n"
        yield
    finally:
        for client in clients:
            client.kill()
            client.wait()


def watch(where: str) -> None:
    """As a browser: take in all records, and read them."""
    port, token = where.split()
    with connect(f"ws://127.0.0.1:{port}/socket?token={token}", origin=f"http://127.0.0.1:{port}") as socket:
        socket.recv()
        socket.send(json.dumps({"want": 1}))
        print("attached", flush=True)
        for said in socket:
            json.loads(said)


def print_opened() -> None:
    """A run of 100,000 records in Chromium: until its first moment is drawn, until all of it is there, scrubbing."""
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "long.jsonl"
        write_long(trace, RECORDS)
        print(f"{RECORDS:,} records, {trace.stat().st_size / 1e6:.0f} MB")
        found = node("open", str(trace), str(RECORDS))
    print(f"opened: first moment {found['first'] / 1000:.2f} s, all there {found['all'] / 1000:.2f} s")
    print(f"jumps: {found['jump']:.1f} ms to a moment, {found['slowest']:.1f} ms for 19 of 20")
    print(f"scrubbed: {found['frame']:.1f} ms from frame to frame, {found['slowestFrame']:.1f} ms for 19 of 20")
    print(f"played: {found['drawn']:.0f} moments a second drawn")


def write_long(path: Path, count: int) -> None:
    """A real run, again and again, numbered on: plots and the world at the start only once."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as once:
        table = deploy(Scenario.parse(SCENARIO), seed=7, faults=0.2, listener=write_to(once))
        with table.executive:
            table.run()
        once.seek(0)
        real = [json.loads(line) for line in once]
    again = [record for record in real if record["type"] not in {"plot", "world", "end"}]
    with path.open("w", encoding="utf-8") as stream:
        stream.write(header(run="clean-up-table, again and again") + "\n")
        for record in _numbered(real[:-1], again, count):
            stream.write(json.dumps(record, ensure_ascii=False) + "\n")


def _numbered(real: list[dict[str, Any]], again: list[dict[str, Any]], count: int) -> Iterator[dict[str, Any]]:
    seq, late, number = 0, 0.0, {None: None}
    records = real
    while seq < count:
        for record in records[: count - seq]:
            seq += 1
            number[record["seq"]] = seq
            yield {**record, "seq": seq, "t": round(record["t"] + late, 6), "cause": number.get(record["cause"])}
        late += real[-1]["t"]
        records = again


def node(*arguments: str) -> dict[str, float]:
    """What `frontend/bench.mjs` says."""
    command = ["node", str(FRONTEND / "bench.mjs"), *arguments]
    said = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    found: dict[str, float] = json.loads(said.splitlines()[-1])
    return found


if __name__ == "__main__":
    main()
