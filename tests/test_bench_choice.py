"""`make bench-choice` works: every choice has its figures."""

import json
import subprocess
import sys
from pathlib import Path

BENCH = Path(__file__).parent.parent / "benchmarks" / "choice.py"


def test_every_choice_is_measured():
    command = [sys.executable, str(BENCH), "--json", "--runs", "4"]
    measured = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert list(measured["choices"]) == ["order", "priority", "learned", "oracle"]
    assert all(one["seconds"]["mean"] > 0 for one in measured["choices"].values())
    assert {one["candidate"] for one in measured["experience"]["tries"]} == {"hand", "suction", "left", "right"}
