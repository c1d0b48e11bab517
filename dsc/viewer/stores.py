"""A knowledge store as records: the world as it is first known, each change since, and what others add meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dsc.trace import Record, header
from dsc.viewer.following import followed
from dsc.viewer.records import RecordLog
from knowledge_base.exchange.forms import delta_form, schema_form, world_form
from knowledge_base.store import KnowledgeBase

if TYPE_CHECKING:
    from knowledge_base.facts import Change


@contextmanager
def following_store(path: Path) -> Iterator[RecordLog]:
    """The records of a store; while the block lasts, those of changes that others make as well.

    Time begins with the first change that is still kept. Changes are followed until the store is compacted beyond
    what was taken in, or its schema grows; then the log ends.

    Raises:
        StoreError: it is not there, is no store, or cannot be read.
    """
    with KnowledgeBase.open(None, path, read_only=True) as kb:
        changes = kb.changes(kb.oldest)
        log = RecordLog(_header(path, changes), live=True)
        start = changes[0].time if changes else None
        first = kb.at(version=kb.oldest)
        log.hear(Record(1, 0.0, "world", None, {
            "version": first.version, "schema": schema_form(first.schema), **world_form(first.snapshot()),
        }))  # fmt: skip

        def hear(change: Change) -> None:
            nonlocal start
            start = change.time if start is None else start
            said = {"version": change.version, "author": change.author, **delta_form(change.delta)}
            log.hear(Record(len(log) + 1, change.time - start, "knowledge", None, said))

        for change in changes:
            hear(change)
        kb.subscribe(hear)
        with followed(log, lambda: kb.refresh() >= 0):
            yield log


def _header(path: Path, changes: list[Change]) -> str:
    began = {"began": datetime.fromtimestamp(changes[0].time, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")} if changes else {}
    return header(run=path.name, store=True, **began)
