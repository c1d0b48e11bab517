"""Garbage collection during a run: long-lived objects are frozen, so that the collector never pauses to scan them."""

from __future__ import annotations

import gc
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_YOUNG = 10_000
"""Allocations between collections of the youngest generation, as a minimum.

The interpreter's default of 700 suits programs with few allocations. One new plan makes twice this number of objects,
most of them short-lived.
"""

_lock = threading.Lock()
_running = 0
_before = gc.get_threshold()


@contextmanager
def settled() -> Iterator[None]:
    """Freeze the existing objects until the end of this run, and of others at the same time.

    A collection of all objects takes a tenth of a second. New objects are collected less often too.
    """
    global _running, _before  # noqa: PLW0603  there is one collector in a process
    with _lock:
        gc.freeze()
        if not _running:
            _before = gc.get_threshold()
            if _before[0]:  # else it is switched off
                gc.set_threshold(max(_before[0], _YOUNG), *_before[1:])
        _running += 1
    try:
        yield
    finally:
        with _lock:
            _running -= 1
            if not _running:
                gc.set_threshold(*_before)
                gc.unfreeze()
