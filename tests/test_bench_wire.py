"""`make bench-wire` works: calls over Zenoh beside a call in a process and bare Zenoh, and the notices of two signals."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("zenoh")
BENCH = Path(__file__).parent.parent / "benchmarks" / "wire.py"


def test_each_call_and_each_signal_has_its_figures_and_targets():
    command: list[str | Path] = [sys.executable, BENCH, "--quick", "--json"]
    measured = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    *calls, killed, stopped = measured["rows"]
    assert len(calls) == 2
    for call in calls:
        assert list(call["cells"]) == ["in a process", "over Zenoh", "bare put and put", "bare query and reply"]
        assert [one["bound"] for one in call["targets"]] == [2.0, 2.0]
    assert killed["cells"]["median"]["value"] < stopped["cells"]["median"]["value"]  # a lease, and a closed connection
