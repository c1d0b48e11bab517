"""What `dsc view` is given, as records: a trace, or a store. Another kind of file is another branch of `records_of`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dsc.viewer.records import read_trace
from knowledge_base.cli.sources import is_store

if TYPE_CHECKING:
    from dsc.viewer.records import RecordLog


@contextmanager
def records_of(path: Path) -> Iterator[RecordLog]:
    """The records in a file, by what the file is; of a store, also those that come while the block lasts.

    Raises:
        InputError: there is no such file, or it is neither a trace nor a store.
    """
    if is_store(path):
        from dsc.viewer.stores import following_store  # noqa: PLC0415  a trace needs no store

        with following_store(path) as log:
            yield log
    else:
        yield read_trace(path)
