"""`make memory` works, and a long run holds no more than a short one."""

import gc
import json
import subprocess
import sys
from pathlib import Path

import pytest

from knowledge_base.journal import memory

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"
EVENTS = 4_000


def test_a_run_holds_nothing_of_what_is_over(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(BENCHMARKS)
    monkeypatch.setattr(memory, "MOST_KEPT", 100)  # the history of knowledge is full at once
    from memory_run import Watch

    blocks = []

    def sample(taken, seconds):
        if taken % (EVENTS // 10) == 0:
            gc.collect()
            blocks.append(sys.getallocatedblocks())

    Watch("trace", EVENTS, tmp_path, sample).run()
    assert len(blocks) == 10
    grown = min(blocks[-3:]) - min(blocks[1:4])
    assert grown < 0.1 * EVENTS  # a name kept for each skill would be 0.4 for each event


def test_every_way_is_measured(tmp_path):
    command = [sys.executable, BENCHMARKS / "memory.py", "--events", "200", "--ways", "store", "--json", "--folder", tmp_path]
    samples = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert [one["events"] for one in samples] == [*range(20, 201, 20)]
    assert samples[-1]["hours"] == pytest.approx(24, rel=0.1)
    assert all(one["rss"] > one["blocks"] > 0 for one in samples)
    assert not list(tmp_path.iterdir())
