"""The soak: thousands of simulated runs of the clean-up table with faults and crashes, each checked for every promise.

`python benchmarks/soak.py --runs N --first SEED --faults P` runs the seeds SEED to SEED + N - 1, on all cores.
`soak_run` draws faults and crashes from the seed. Exit status 1 if a run broke a promise, with the command to repeat
it.
"""

from __future__ import annotations

import argparse
import gc
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from functools import partial
from pathlib import Path

from soak_judge import PROMISES
from soak_run import Outcome, Planners, Trial

TOLD_EVERY = 1000
"""Number of runs between two progress lines."""
SHOWN = 10
"""Maximum number of seeds in the summary."""
MEMORY = Path("/dev/shm")  # noqa: S108  files in memory where possible, so that no run waits for a disk
_planners: Planners | None = None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="how many seeds")
    parser.add_argument("--first", type=int, default=0, help="the first one")
    parser.add_argument("--faults", type=float, default=0.1, help="chance of a fault per skill call")
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="how many at once")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.runs)
    print(f"commit {commit()}, seeds {seeds.start} to {seeds.stop - 1}, faults {options.faults:g}")
    started, outcomes = time.perf_counter(), []
    with multiprocessing.get_context("spawn").Pool(options.processes, prepare) as pool:
        for outcome in pool.imap_unordered(partial(lived, chance=options.faults), seeds, chunksize=5):
            outcomes.append(outcome)
            tell_progress(len(outcomes), options.runs, time.perf_counter() - started)
        pool.close()
        pool.join()
    seconds = time.perf_counter() - started
    print("\n".join(summary(outcomes)))
    print(f"{len(outcomes)} runs in {seconds:.0f} s, {len(outcomes) / seconds:.1f} a second")
    wrong = sorted((one for one in outcomes if one.wrong), key=lambda one: one.seed)
    for outcome in wrong[:SHOWN]:
        print(f"seed {outcome.seed}: {'; '.join(f'{promise}: {what}' for promise, what in outcome.wrong)}")
        print(f"  again: make soak RUNS=1 FIRST={outcome.seed} FAULTS={options.faults:g}")
    sys.exit(1 if wrong else 0)


def tell_progress(lived: int, runs: int, seconds: float) -> None:
    """Print the progress after each run on a terminal, periodically in a file."""
    if sys.stderr.isatty():
        print(f"\r{lived} of {runs}", end="\n" if lived == runs else "", file=sys.stderr)
    elif lived % TOLD_EVERY == 0:
        print(f"{lived} of {runs} after {seconds:.0f} s", file=sys.stderr, flush=True)


def prepare() -> None:
    """Prepare a process for all its runs."""
    global _planners  # noqa: PLW0603  one for each process, which ends them with itself
    _planners = Planners()
    gc.freeze()  # present objects stay
    gc.set_threshold(20_000)


def lived(seed: int, chance: float) -> Outcome:
    assert _planners is not None
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        return Trial(seed, chance, _planners, Path(folder)).run()


def summary(outcomes: list[Outcome]) -> list[str]:
    """Return counts over all runs, and the number of violations of each promise."""
    broken = Counter(promise for one in outcomes for promise in {promise for promise, _ in one.wrong})
    counts = {
        "outcomes": Counter(one.how for one in outcomes),
        "faults": sum((one.faults for one in outcomes), Counter()),
        "crashes": sum((one.crashes for one in outcomes), Counter()),
        "in all": Counter(lives=sum(one.lives for one in outcomes), macrosteps=sum(one.steps for one in outcomes)),
    }
    lines = [f"{name}: {', '.join(f'{key} {n}' for key, n in c.most_common())}" for name, c in counts.items()]
    return [*lines, "broken: " + ", ".join(f"{promise} {broken[promise]}" for promise in PROMISES)]


def commit() -> str:
    """Return the commit of the checkout, marked if a file differs from it."""
    command = ["git", "describe", "--always", "--dirty", "--abbrev=12"]
    found = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    return found.stdout.strip() or "unknown"


if __name__ == "__main__":
    main()
