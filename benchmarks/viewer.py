"""The cost of the page: its size, its layouts, a watched run, and opening a long run (`make bench-viewer`).

`watched.py` measures watched runs, `frontend/bench.mjs` layouts and pages.
"""

from __future__ import annotations

import argparse
import gzip
import json
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from watched import SCENARIO, print_watched

from domains.clean_up_table.bringup import deploy
from domains.clean_up_table.scenario import Scenario
from dsc.trace import header, write_to
from dsc.viewer.server import STATIC

FRONTEND = Path(__file__).parent.parent / "frontend"
RECORDS = 100_000
ROUNDS = 12


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="runs with each number of browsers")
    chosen = parser.parse_args()
    print_weight()
    print_watched(chosen.rounds)
    for count, milliseconds in node("layout").items():
        print(f"layout of {count:>4} states   {milliseconds:7.0f} ms")
    print_opened()


def print_weight() -> None:
    """Print the compressed size of the page in bytes, without and with the layout worker."""
    sizes = {path.name: len(gzip.compress(path.read_bytes())) for path in STATIC.rglob("*") if path.suffix in _FETCHED}
    worker = sizes.pop("elk-worker.min.js")
    print(f"page {sum(sizes.values()) / 1000:.0f} kB compressed, worker for layouts {worker / 1000:.0f} kB")


_FETCHED = {".html", ".js", ".css", ".svg"}


def print_opened() -> None:
    """Print times for a run of 100,000 records in Chromium: first moment drawn, all loaded, scrubbing."""
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
    """Write a real run repeatedly, with consecutive numbers; plots and the initial world appear once."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as once:
        table = deploy(Scenario.parse(SCENARIO), seed=7, faults=0.2, listener=write_to(once))
        with table:
            table.report()
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
    """Return the figures of `frontend/bench.mjs`."""
    command = ["node", str(FRONTEND / "bench.mjs"), *arguments]
    said = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    found: dict[str, float] = json.loads(said.splitlines()[-1])
    return found


if __name__ == "__main__":
    main()
