"""A run that is kept in a store, as records: those it has made, and those it makes while somebody looks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dsc.sequencer.run_tables import archive
from dsc.trace import Record, header
from dsc.viewer.following import followed
from dsc.viewer.records import RecordLog
from knowledge_base.errors import Place, StoreError


@contextmanager
def following_run(path: Path) -> Iterator[RecordLog]:
    """The records of the last run in a store; while the block lasts, those that it goes on to make as well.

    Raises:
        StoreError: the file is not there, not a store, has no run, or cannot be read.
    """
    with archive(path) as runs:
        run = runs.run()
    log = RecordLog(header(**run.header), live=True)
    place = 0

    def look() -> bool:
        nonlocal place
        with archive(path, again=True) as runs:
            for here, line in runs.lines(run.number, place):
                if (record := _record(line, len(log), path)).seq > len(log):  # a macrostep may get more at its end
                    log.hear(record)
                place = here
            return runs.run(run.number).ended is None

    if look():
        with followed(log, look):
            yield log
    else:
        log.end()
        yield log


def _record(line: str, last: int, path: Path) -> Record:
    try:
        return Record.from_line(line)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise StoreError(f"a record after record {last} is damaged: {error!r}", place=Place(str(path))) from None
