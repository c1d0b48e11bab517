"""Garbage collection during a run in real time; only a program that belongs to the run may change it."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_YOUNG = 10_000
"""The least number of allocations between two collections of the youngest generation.

The interpreter's default of 700 suits programs with few allocations. One new plan allocates 20,000 objects, most of
them short-lived.
"""

_lock = threading.Lock()
_thresholds: list[tuple[int, int, int]] = []
"""The thresholds of the garbage collector before each run in progress."""


@contextmanager
def settled() -> Iterator[None]:
    """Exclude the existing objects from garbage collection until the end of all runs in progress.

    A collection of all objects takes a tenth of a second. New objects are also collected less often.
    """
    with _lock:
        gc.freeze()
        before = gc.get_threshold()
        _thresholds.append(before)
        if before[0]:  # 0 means that collection is disabled
            gc.set_threshold(max(before[0], _YOUNG), *before[1:])
    try:
        yield
    finally:
        with _lock:
            gc.set_threshold(*_thresholds.pop())
            if not _thresholds:
                gc.unfreeze()
