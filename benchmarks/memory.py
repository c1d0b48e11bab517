"""Memory of a long run in simulated time: flat after its first tenth, without a store, with one, and with a trace file.

`python benchmarks/memory.py [--events N] [--json] [--ways W ...]` runs 24 simulated hours of a robot on watch. Skills
send reports, an observed fact changes, periods pass, timeouts are cancelled, and a rule answers failures.

The program prints the memory at each tenth. Its exit status is 1 if the last nine tenths grow by more than `MOST`.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from memory_run import WAYS, Watch

EVENTS = 1_000_000
MOST = 0.02
"""Growth of blocks in use and of the resident set: SQLite's pages and the allocator's gaps settle slowly."""
TENTHS = 10
PAGE = 4096


@dataclass(frozen=True, slots=True)
class Sample:
    """The memory of a run after a number of events.

    Attributes:
        events: number of events so far.
        hours: run time.
        blocks: blocks of Python's allocator in use, after a garbage collection.
        rss: resident bytes.
    """

    events: int
    hours: float
    blocks: int
    rss: int


def measured(way: str, events: int, folder: Path) -> list[Sample]:
    """Return one sample at each tenth of a run."""
    samples: list[Sample] = []

    def sample(taken: int, seconds: float) -> None:
        if taken >= (len(samples) + 1) * events // TENTHS:
            gc.collect()
            resident = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * PAGE
            samples.append(Sample(taken, seconds / 3600, sys.getallocatedblocks(), resident))

    Watch(way, events, folder, sample).run()
    return samples


def growth(samples: list[Sample], what: str) -> float:
    """Return the growth of the largest later sample over the first, as a share."""
    first, *others = (getattr(one, what) for one in samples)
    return max(others) / first - 1


def told(way: str, samples: list[Sample]) -> list[str]:
    """Return the table of a run, and its growth."""
    lines = [f"{way}:", "   events    hours      blocks    RSS MB"]
    lines += [f"{s.events:9,} {s.hours:8.1f} {s.blocks:11,} {s.rss / 1e6:9.1f}" for s in samples]
    said = ", ".join(f"{what} {growth(samples, what):+.2%}" for what in ("blocks", "rss"))
    return [*lines, f"growth after the first tenth: {said}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--events", type=int, default=EVENTS, help="in 24 simulated hours, whatever their number")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS, help="how the run is kept")
    parser.add_argument("--folder", type=Path, help="where files are made")
    parser.add_argument("--json", action="store_true", help="one run in this process, as plain data")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        if options.json:
            print(json.dumps([asdict(one) for one in measured(options.ways[0], options.events, Path(folder))]))
            return
    grown = False
    for way in options.ways:  # each in a separate process with its own memory
        command = [sys.executable, __file__, "--json", "--events", str(options.events), "--ways", way]
        if options.folder is not None:
            command += ["--folder", str(options.folder)]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        samples = [Sample(**one) for one in json.loads(said)]
        print("\n".join(told(way, samples)), flush=True)
        grown = grown or max(growth(samples, "blocks"), growth(samples, "rss")) > MOST
    sys.exit(1 if grown else 0)


if __name__ == "__main__":
    main()
