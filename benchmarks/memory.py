"""Memory of a long run in simulated time: flat after its first tenth, without a store, with one, and with a trace file.

`python benchmarks/memory.py [--events N] [--json] [--ways W ...]` lives 24 simulated hours of a robot on watch: skills
with reports, an observed fact that changes, periods, timeouts that are cancelled, and failures that a rule answers.
It prints the memory at each tenth; exit status 1 if the last nine tenths grow by more than `MOST`.
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
"""Growth of blocks in use and of the resident set: the pages of SQLite and gaps of the allocator settle slowly."""
TENTHS = 10
PAGE = 4096


@dataclass(frozen=True, slots=True)
class Sample:
    """What a run holds after so many events.

    Attributes:
        events: taken so far.
        hours: of run time.
        blocks: that Python's allocator has given out, garbage collected before.
        rss: bytes that are resident.
    """

    events: int
    hours: float
    blocks: int
    rss: int


def measured(way: str, events: int, folder: Path) -> list[Sample]:
    """One sample at each tenth of a run."""
    samples: list[Sample] = []

    def sample(taken: int, seconds: float) -> None:
        if taken >= (len(samples) + 1) * events // TENTHS:
            gc.collect()
            resident = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * PAGE
            samples.append(Sample(taken, seconds / 3600, sys.getallocatedblocks(), resident))

    Watch(way, events, folder, sample).run()
    return samples


def growth(samples: list[Sample], what: str) -> float:
    """By how much the most of the last nine tenths exceeds the first, as a share."""
    first, *others = (getattr(one, what) for one in samples)
    return max(others) / first - 1


def told(way: str, samples: list[Sample]) -> list[str]:
    """The table of a run, and its growth."""
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
    for way in options.ways:  # each in a process of its own, whose memory is its own
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
