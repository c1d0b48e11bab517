"""`make bench-run` works: every way to run has its figures, and its ratios."""

import re
import subprocess
import sys
from pathlib import Path

BENCH = Path(__file__).parent.parent / "benchmarks" / "run_store.py"


def test_every_way_to_run_a_chart_is_timed(tmp_path):
    command = [sys.executable, BENCH, "--quick", "--folder", tmp_path]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    rows = re.findall(r"^\| (.*?) \| ([\d.]+) \| [\d,]+ \| ([\d.]+) \|", printed, flags=re.MULTILINE)
    assert [name for name, *_ in rows] == 2 * [
        "the engine alone", "one asyncio.Queue hop", "without a store", "with a store, process",
        "a bare commit, process", "with a store, power", "a bare commit, power",
    ]  # fmt: skip
    assert all(float(us) > 0 for _, us, *_ in rows)
    assert re.findall(r"^\| (\d+) \| [\d.]+ \| [\d.]+ \|", printed, flags=re.MULTILINE) == ["1", "5"]
    assert len(re.findall(r"\| (met|missed) \|", printed)) == 4
    assert not list(tmp_path.iterdir())
