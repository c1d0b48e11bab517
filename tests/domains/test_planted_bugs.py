"""What the soak would see: each planted bug breaks a promise within 1,000 runs, the first of which are tried here.

Tried from the seed at which it was seen when this was written; should plots change, the search goes on from there.
"""

from __future__ import annotations

import pytest
from planted_bugs import (
    a_new_id_on_retry,
    answers_dropped_with_their_state,
    dispatch_before_commit,
    failures_not_recorded,
    no_fence,
)
from soak_judge import HISTORY, NOT_SO, TWICE
from test_soak import lived, planners  # noqa: F401  a fixture

RUNS = 1000
FORGETFUL = 456
BUGS = [
    (a_new_id_on_retry, 8, TWICE),
    (dispatch_before_commit, 8, TWICE),
    (no_fence, 129, HISTORY),
    (failures_not_recorded, 3, HISTORY),
    (answers_dropped_with_their_state, FORGETFUL, NOT_SO),
]


@pytest.mark.parametrize(("bug", "first", "promise"), BUGS, ids=[bug.__name__ for bug, *_ in BUGS])
def test_a_planted_bug_is_caught(bug, first, promise, planners, monkeypatch):  # noqa: F811
    with monkeypatch.context() as planted:
        bug(planted)
        for seed in range(first, first + RUNS):
            broken = {promise for promise, _ in lived(seed, planners).wrong}
            if promise in broken:
                break
    assert promise in broken
    assert lived(seed, planners).wrong == []


def test_only_the_shuffling_scheduler_shows_what_hangs_on_the_order_at_one_moment(planners, monkeypatch):  # noqa: F811
    answers_dropped_with_their_state(monkeypatch)
    assert NOT_SO in {promise for promise, _ in lived(FORGETFUL, planners, interleaved=True).wrong}
    for seed in range(FORGETFUL, FORGETFUL + 3):
        assert lived(seed, planners, interleaved=False).wrong == []
