"""What the soak would see: each planted bug breaks a promise within 1,000 runs, the first of which are tried here.

Tried from the seed at which it was seen when this was written; should plots change, the search goes on from there.
"""

from __future__ import annotations

import pytest
from planted_bugs import a_new_id_on_retry, dispatch_before_commit, failures_not_recorded, no_fence
from test_soak import lived, planners  # noqa: F401  a fixture

RUNS = 1000
BUGS = [
    (a_new_id_on_retry, 8, "executed twice"),
    (dispatch_before_commit, 8, "executed twice"),
    (no_fence, 129, "another history"),
    (failures_not_recorded, 3, "another history"),
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
