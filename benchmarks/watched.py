"""The slowdown of watched runs, in the hardest case: simulated time, which never waits.

Each round has each number of browsers in turn, in a rotating order. The figures are ratios to the same runs without a
page in the same round. They compare real time, and processor time of the run's own process.

The output is the median of the rounds, with the interval that contains the true median in 19 of 20 measurements (sign
test). All plans are cached before, so that only the run is measured. A garbage collection precedes each run, so that it
pays for its own objects only.

Each browser is a process that receives and parses all records. It shares two cores with the run, the page, and other
load of the machine, which the output states.
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

from domains.clean_up_table.bringup import deploy
from domains.clean_up_table.scenario import Scenario
from dsc.trace import Listener, header
from dsc.viewer.access import PageAddress
from dsc.viewer.live import LivePage
from planning import Planner
from planning.engines.planner import PlannerProcess
from planning.engines.race import CachingPlanner

WATCHED = {"no page": None, "nobody looks": 0, "1 browser": 1, "8 browsers": 8}
SCENARIO = "table: {cups: 4, cans: 3, crisp_cans: [small, large]}"
SEEDS = (0, 1, 2, 3) * 2
"""Seeds of consecutive runs with faults: one run alone is too short to measure."""
DOUBT = 1 / 20


class Taken(NamedTuple):
    """Seconds: real time, processor time of this process (all threads), and processor time of other processes."""

    wall: float
    cpu: float
    others: float


def print_watched(rounds: int) -> None:
    """Print a line for each number of browsers."""
    process = PlannerProcess()
    planner = CachingPlanner(process)
    runs(planner, None)  # caches all plans
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
    """Return the median ratio of the rounds, with its interval."""
    found = sorted(one / other for one, other in zip(seconds, bare, strict=True))
    below = sum(1 for rank in range(1, len(found) // 2) if _chance_below(rank, len(found)) <= DOUBT / 2)
    low, high = found[below], found[-1 - below]
    return f"{statistics.median(found):5.3f} x ({low:5.3f} to {high:5.3f})"


def _chance_below(rank: int, count: int) -> float:
    """Return the probability that at most `rank` rounds are on one side of the true median."""
    return sum(math.comb(count, k) for k in range(rank + 1)) / 2**count


def runs_watched(browsers: int | None, planner: Planner) -> Taken:
    """Return the times of the runs with that number of browsers; `None` means without a page and without records."""
    if browsers is None:
        return runs(planner, None)
    with ExitStack() as stack:
        page = LivePage(header(), PageAddress.on())
        page.start()
        stack.callback(page.close)
        with opened(str(page.port), page.token) as socket:
            socket.recv()  # its process has started
        stack.enter_context(watching(page, browsers))
        return runs(planner, page.receive)


def runs(planner: Planner, listener: Listener | None) -> Taken:
    """Return the times of all runs, without their deployment."""
    gc.collect()
    gc.freeze()  # a run in a separate process would not have objects of earlier runs
    taken = []
    for seed in SEEDS:
        table = deploy(Scenario.parse(SCENARIO), seed, 0.2, planner, listener)
        with table:
            machine, wall, cpu = busy_seconds(), time.perf_counter(), time.process_time()
            table.report()
            own = time.process_time() - cpu
            taken.append(Taken(time.perf_counter() - wall, own, busy_seconds() - machine - own))
    gc.unfreeze()
    return Taken(*map(sum, zip(*taken, strict=True)))


def busy_seconds() -> float:
    """Return the processor time of all cores together."""
    user, nice, system, _idle, _waiting, *interrupts = map(int, Path("/proc/stat").read_text().split()[1:8])
    return (user + nice + system + sum(interrupts)) / 100


@contextmanager
def watching(page: LivePage, count: int) -> Iterator[None]:
    """Run that number of browser processes, after each has attached."""
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
    """Open a socket as the page does."""
    return connect(f"ws://127.0.0.1:{port}/socket?token={token}", origin=f"http://127.0.0.1:{port}", open_timeout=60)


def watch(port: str, token: str) -> None:
    """Act as a browser: receive all records, and parse them."""
    with opened(port, token) as socket:
        socket.recv()
        socket.send(json.dumps({"want": 1}))
        print("attached", flush=True)
        for said in socket:
            json.loads(said)


if __name__ == "__main__":
    watch(*sys.argv[1:])
