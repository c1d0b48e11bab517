"""Record sources of the page: a trace, a kept run, or a knowledge store, read while a writer appends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from threading import Event, Thread

from dsc.runs.archive import archive, has_run
from dsc.trace import Record, header
from dsc.viewer.records import RecordLog, read_trace
from knowledge_base.errors import HistoryError, Place, StoreError
from knowledge_base.exchange import delta_form, schema_form, world_form
from knowledge_base.facts import Change
from knowledge_base.journal.file import located
from knowledge_base.journal.sidecar_files import has_writer, is_database
from knowledge_base.store import KnowledgeBase

LOOK_EVERY_S = 0.2


@contextmanager
def followed(log: RecordLog, look: Callable[[], bool]) -> Iterator[RecordLog]:
    """Poll `look` during the block, until it returns false or raises an error; `look` appends records to the log."""
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


@contextmanager
def following_run(path: Path) -> Iterator[RecordLog]:
    """Yield the records of the last run in a store; append new records during the block.

    The log is live while a program has the store of an unfinished run open.

    Raises:
        StoreError: the file is missing, not a store, has no run, or cannot be read.
    """
    with archive(path) as runs:
        run = runs.run()
    log = RecordLog(header(**run.header), live=True)
    place = 0

    def look() -> bool:
        nonlocal place
        written = has_writer(located(path))  # before the records, so that none follows a log that is over
        with archive(path, again=True) as runs:
            for here, line in runs.lines(run.number, place):
                if (record := _record(line, len(log), path)).seq > len(log):  # the last macrostep may get more records
                    log.receive(record)
                place = here
            unfinished = runs.run(run.number).ended is None
        if unfinished and written != log.live:
            log.mark(live=written)
        return unfinished

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


@contextmanager
def following_store(path: Path) -> Iterator[RecordLog]:
    """Yield the records of a knowledge store; append the changes of other programs during the block.

    Time begins with the first kept change. The log ends when the store drops changes that were not read yet, or when
    the store's schema grows.

    Raises:
        StoreError: the file is missing, is not a store, or cannot be read.
    """
    with KnowledgeBase.open(None, path, read_only=True) as kb:
        changes = kb.changes(kb.oldest)
        log = RecordLog(_header(path, changes), live=True)
        start = changes[0].time if changes else None
        first = kb.at(version=kb.oldest)
        log.receive(Record(1, 0.0, "world", None, {
            "version": first.version, "schema": schema_form(first.schema), **world_form(first.snapshot()),
        }))  # fmt: skip

        def receive(change: Change) -> None:
            nonlocal start
            start = change.time if start is None else start
            data = {"version": change.version, "author": change.author, **delta_form(change.delta)}
            log.receive(Record(len(log) + 1, change.time - start, "knowledge", None, data))

        for change in changes:
            receive(change)
        kb.subscribe(receive)
        with followed(log, lambda: kb.refresh() >= 0):
            yield log


def _header(path: Path, changes: list[Change]) -> str:
    began = {"began": datetime.fromtimestamp(changes[0].time, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")} if changes else {}
    return header(run=path.name, store=True, **began)


@contextmanager
def records_of(path: Path) -> Iterator[RecordLog]:
    """Yield the records in a trace or store; for a store, append new records during the block.

    A store with runs yields the records of its last run; another store yields the changes of its knowledge.

    Raises:
        InputError: the file is missing, or it is neither a trace nor a store.
    """
    if is_database(path):
        with (following_run if has_run(path) else following_store)(path) as log:
            yield log
    else:
        yield read_trace(path)
