"""`make bench-calls` works, and no main path has grown by more than a tenth since its counts were written down."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parent.parent / "benchmarks" / "calls.py"
KEPT = json.loads(BENCH.with_name("calls.json").read_text(encoding="utf-8"))
GROWTH = 1.1


@pytest.fixture(scope="module")
def counted():
    command: list[str | Path] = [sys.executable, BENCH, "--json", "--rounds", "0"]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def test_every_flow_has_a_kept_count(counted):
    assert list(counted) == list(KEPT)


@pytest.mark.parametrize("flow", KEPT)
def test_no_flow_has_grown_by_more_than_a_tenth(counted, flow):
    assert KEPT[flow] / 2 < counted[flow]["calls"] <= GROWTH * KEPT[flow], "make bench-calls WRITE=1 writes new counts"


@pytest.mark.parametrize("flow", KEPT)
def test_a_hop_is_a_call_from_file_to_file(counted, flow):
    assert 1 < counted[flow]["files"] <= counted[flow]["hops"] <= counted[flow]["calls"]
