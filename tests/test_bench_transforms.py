"""`make bench-transforms` works: random trees agree with scipy, and every job has its figures."""

import json
import subprocess
import sys
from pathlib import Path

BENCH = Path(__file__).parent.parent / "benchmarks" / "transforms.py"


def test_random_trees_agree_and_every_job_is_measured():
    command = [sys.executable, str(BENCH), "--json", "--trees", "30", "--rounds", "1", "--seconds", "0.005"]
    measured = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert measured["trees"] == 30
    assert measured["largest error"] < 1e-9
    assert list(measured["rows"]) == [
        "scipy", "update", "look-up of static arcs", "look-up with interpolation", "update, bound, without readers",
        "update, bound, a condition on the chain", "update, bound, ten conditions",
    ]  # fmt: skip
    assert all(row["ratio"] > 0 for row in measured["rows"].values())
