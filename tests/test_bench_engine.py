"""`make bench-engine` works without the peers: the floor and this engine do every case, and targets are judged."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ENGINE = Path(__file__).parent.parent / "benchmarks" / "engine.py"
FOR_ALL = {"ping-pong", "5 levels", "4 regions", "ring of 1,000 states", "1,000 instances in turn",
           "build of 1,000 states", "memory of an instance"}  # fmt: skip


@pytest.fixture(scope="module")
def rows():
    command: list[str | Path] = [sys.executable, ENGINE, "--quick", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {row["case"]: row for row in json.loads(done.stdout)["rows"]}


def test_every_case_has_a_figure(rows):
    assert set(rows) > FOR_ALL
    for case, row in rows.items():
        doers = {"bare loop", "floor", "this engine"} if case in FOR_ALL else {"this engine"}
        assert doers <= set(row["cells"]), case
        assert all(cell["value"] > 0 for cell in row["cells"].values()), case


def test_targets_are_judged_by_their_figures(rows):
    targets = [target for row in rows.values() for target in row["targets"]]
    assert len(targets) == 9
    for one in targets:
        least, value = one["target"].startswith("≥"), one["value"]
        expected = None if value is None else value >= one["bound"] if least else value <= one["bound"]
        assert one["met"] is expected, one["target"]


def test_a_submachine_is_compared_with_the_floor(rows):
    row = rows["submachine left and bound anew"]
    assert row["cells"]["this engine"]["against"] == "floor"
    assert row["targets"][0]["value"] == row["cells"]["this engine"]["times"]
