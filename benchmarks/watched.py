"""How much longer runs take when they are watched: the hardest case, runs in simulated time, which never wait.

Each round has all numbers of browsers, in turn, and who begins changes from round to round. What counts is the ratio to
the same runs without a page in the same round: of the time by the clock, and of the computing time of the run's own
process. Said are the median of the rounds and the interval in which the true median lies in 19 of 20 measurements (sign
test), so that one sees what can be told apart. All plans are known before, so that nothing but the run is measured; the
garbage of others is collected before, so that nobody pays for it.

Each browser is a process that takes in and reads all records. It has to share two cores with the run, the page, and
whatever else the machine does, which is said as well.
"""

from __future__ import annotations

import gc
import json
import math
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from websockets.sync.client import ClientConnection, connect

from domains.clean_up_table.deployment import deploy
from domains.clean_up_table.scenario import Scenario
from dsc.trace import Listener, header
from dsc.viewer.address import PageAddress
from dsc.viewer.live import LivePage
from planning import Planner
from planning.engines.cache import CachingPlanner
from planning.engines.planner import PlannerProcess

WATCHED = {"no page": None, "nobody looks": 0, "1 browser": 1, "8 browsers": 8}
SCENARIO = "table: {cups: 4, cans: 3, crisp_cans: [small, large]}"
SEEDS = (0, 1, 2, 3) * 2
"""Runs with faults, one after the other: one alone is too short to be measured."""
DOUBT = 1 / 20


class Taken(NamedTuple):
    """Seconds: by the clock, of computing in this process (all threads), and of computing by strangers."""

    wall: float
    cpu: float
    others: float


def print_watched(rounds: int) -> None:
    """A line for each number of browsers."""
    process = PlannerProcess()
    planner = CachingPlanner(process)
    runs(planner, None)  # all plans are known from here on
    figures: dict[str, list[Taken]] = {name: [] for name in WATCHED}
    for number in range(rounds):
        first = number % len(WATCHED)
        for name in [*WATCHED][first:] + [*WATCHED][:first]:
            figures[name].append(runs_watched(WATCHED[name], planner))
    process.kill()
    bare = figures["no page"]
    print(f"{len(SEEDS)} runs one after the other, {rounds} rounds; median (19 in 20) of the ratios to no page:")
    for name, taken in figures.items():
        wall = ratios([one.wall for one in taken], [one.wall for one in bare])
        cpu = ratios([one.cpu for one in taken], [one.cpu for one in bare])
        seconds = statistics.median(one.wall for one in taken)
        print(f"  {name:<12} {seconds:5.2f} s   by the clock {wall}   computing of the run's process {cpu}")
    busy = statistics.median(one.others / one.wall for one in bare)
    print(f"  others had {busy:.2f} of the machine's cores meanwhile")


def ratios(seconds: list[float], bare: list[float]) -> str:
    """The median of what each round says, and how far it can be trusted."""
    found = sorted(one / other for one, other in zip(seconds, bare, strict=True))
    below = sum(1 for rank in range(1, len(found) // 2) if _chance_below(rank, len(found)) <= DOUBT / 2)
    low, high = found[below], found[-1 - below]
    return f"{statistics.median(found):5.3f} x ({low:5.3f} to {high:5.3f})"


def _chance_below(rank: int, count: int) -> float:
    """That at most so many of the rounds are on one side of the true median."""
    return sum(math.comb(count, k) for k in range(rank + 1)) / 2**count


def runs_watched(browsers: int | None, planner: Planner) -> Taken:
    """What the runs take with so many browsers; `None` browsers are runs without a page and without records."""
    if browsers is None:
        return runs(planner, None)
    with ExitStack() as stack:
        page = LivePage(header(), PageAddress.on())
        page.start()
        stack.callback(page.close)
        with opened(str(page.port), page.token) as socket:
            socket.recv()  # its process has started
        stack.enter_context(watching(page, browsers))
        return runs(planner, page.hear)


def runs(planner: Planner, listener: Listener | None) -> Taken:
    """All of them, measured without their deployment."""
    gc.collect()
    gc.freeze()  # a run in a process of its own does not have what the runs before have left
    taken = []
    for seed in SEEDS:
        table = deploy(Scenario.parse(SCENARIO), seed, 0.2, planner, listener)
        with table.executive:
            machine, wall, cpu = busy_seconds(), time.perf_counter(), time.process_time()
            table.run()
            own = time.process_time() - cpu
            taken.append(Taken(time.perf_counter() - wall, own, busy_seconds() - machine - own))
    gc.unfreeze()
    return Taken(*map(sum, zip(*taken, strict=True)))


def busy_seconds() -> float:
    """What all cores together have computed."""
    user, nice, system, _idle, _waiting, *interrupts = map(int, Path("/proc/stat").read_text().split()[1:8])
    return (user + nice + system + sum(interrupts)) / 100


@contextmanager
def watching(page: LivePage, count: int) -> Iterator[None]:
    """So many processes attached, each of which has said that it is."""
    command = [sys.executable, __file__, str(page.port), page.token]
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


def opened(port: str, token: str) -> ClientConnection:
    """A socket as the page opens it."""
    return connect(f"ws://127.0.0.1:{port}/socket?token={token}", origin=f"http://127.0.0.1:{port}", open_timeout=60)


def watch(port: str, token: str) -> None:
    """As a browser: take in all records, and read them."""
    with opened(port, token) as socket:
        socket.recv()
        socket.send(json.dumps({"want": 1}))
        print("attached", flush=True)
        for said in socket:
            json.loads(said)


if __name__ == "__main__":
    watch(*sys.argv[1:])
