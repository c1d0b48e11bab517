"""`make memory` works, and a long run holds no more than a short one."""

import gc
import json
import subprocess
import sys
from pathlib import Path

import pytest

from knowledge_base.journal import history

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"
EVENTS = 6_000
EACH = 200


@pytest.fixture
def _quick_collections():
    """What was there before is not looked through."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("_quick_collections")
def test_a_run_holds_nothing_of_what_is_over(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(BENCHMARKS)
    monkeypatch.setattr(history, "MOST_KEPT", 100)  # the history of knowledge is full at once
    from memory_run import Watch

    blocks = []

    def sample(taken, seconds):
        if taken % EACH == 0:
            gc.collect()
            blocks.append(sys.getallocatedblocks())

    Watch("trace", EVENTS, tmp_path, sample).run()
    assert len(blocks) == EVENTS // EACH
    _, *later = blocks
    half = len(later) // 2  # cancelled timers are thrown away together, every 2,000 events: each half has such a moment
    grown = min(later[half:]) - min(later[:half])
    assert grown < EVENTS / 6  # a name kept for each skill would be twice as much


def test_every_way_is_measured(tmp_path):
    command = [
        sys.executable,
        BENCHMARKS / "memory.py",
        "--events",
        "200",
        "--ways",
        "store",
        "--json",
        "--folder",
        tmp_path,
    ]
    samples = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert [one["events"] for one in samples] == [*range(20, 201, 20)]
    assert samples[-1]["hours"] == pytest.approx(24, rel=0.1)
    assert all(one["rss"] > one["blocks"] > 0 for one in samples)
    assert not list(tmp_path.iterdir())
