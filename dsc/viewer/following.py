"""Looking at a file again and again for what its writer has added."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING

from knowledge_base.errors import HistoryError, StoreError

if TYPE_CHECKING:
    from dsc.viewer.records import RecordLog

LOOK_EVERY_S = 0.2


@contextmanager
def followed(log: RecordLog, look: Callable[[], bool]) -> Iterator[RecordLog]:
    """The log, which `look` adds to while the block lasts, until it says that there will be no more or cannot go on."""
    over = Event()

    def looking() -> None:
        while not over.wait(LOOK_EVERY_S):
            try:
                if not look():
                    break
            except (HistoryError, StoreError):
                break
        log.end()

    thread = Thread(target=looking, daemon=True)
    thread.start()
    try:
        yield log
    finally:
        over.set()
        thread.join()
