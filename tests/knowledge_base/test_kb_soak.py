"""Threads and an event loop at once: nothing lost, nothing out of order, nobody stuck (`make soak-kb` for longer)."""

from __future__ import annotations

import pytest
from kb_soak import WORKERS, soak


@pytest.mark.parametrize("kept", ["in memory", "in a file"])
def test_threads_and_a_loop_lose_nothing_and_hear_all_in_order(tmp_path, kept: str) -> None:
    done = soak(tmp_path / "world.kb" if kept == "in a file" else None, lambda commits: commits < 60, 120)
    assert done.failures == []
    assert done.acknowledged == dict.fromkeys(WORKERS, 60)
    assert done.firings
