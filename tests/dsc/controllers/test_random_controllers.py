"""Random charts: the engine, the Python controller and the C controller do the same, call by call."""

from __future__ import annotations

import shutil
from collections import Counter

import pytest
from controller_players import EnginePlayer, PythonPlayer
from controllers_soak import DiffersError, compare, run
from dsc_charts import plot

CC = shutil.which("cc")


def test_random_charts_by_the_engine_and_both_controllers():
    counts: Counter[str] = Counter()
    run(range(12), 3, CC, counts, batch=12)
    assert counts["transitions"] > 500
    assert min(counts["with_timers"], counts["with_overflow"], counts["compared"]) > 3
    if CC is None:
        pytest.skip("there is no C compiler `cc`; the Python controllers agree with the engine")
    assert counts["c_calls"] == counts["calls"] + counts["cycles"]
    assert counts["cycles_compared"] > 200
    assert counts["configurations_in_cycles"] > 50


def test_a_difference_is_found():
    player = EnginePlayer(plot("{plot: p, states: {a: {on: {e: b}}, b: {}}}"))
    player.play([("e", 0, {}, 0), ("step", 0, {}, 1)])
    other = PythonPlayer(plot("{plot: p, states: {a: {on: {e: {}}}, b: {}}}"))
    with pytest.raises(DiffersError, match="call 2"):
        compare(player.records, [*other.play(player.calls)], "these")
