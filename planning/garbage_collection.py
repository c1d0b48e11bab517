"""The garbage collector while robots run: it must not stop them to look at what is going to stay."""

from __future__ import annotations

import gc
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_YOUNG = 10_000
"""After so many new things they are looked through, if not after more; the interpreter's own 700 suit programs that
make few. One new plan makes twice as many as this, most of them for a moment."""

_lock = threading.Lock()
_running = 0
_before = gc.get_threshold()


@contextmanager
def settled() -> Iterator[None]:
    """Until the end of this run, and of others at the same time, the collector leaves alone what is there now.

    A look at all of it takes a tenth of a second. New things are looked through less often.
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
