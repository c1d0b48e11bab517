"""What `dsc view` is given, as records: a trace, a kept run, or a knowledge store."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dsc.viewer.records import read_trace
from knowledge_base.journal.neighbours import is_database

if TYPE_CHECKING:
    from dsc.viewer.records import RecordLog


@contextmanager
def records_of(path: Path) -> Iterator[RecordLog]:
    """The records in a file, by what the file is; of a store, also those that come while the block lasts.

    Of a store with runs in it, those of its last run; of another one, the changes of what is known.

    Raises:
        InputError: there is no such file, or it is neither a trace nor a store.
    """
    if is_database(path):
        from dsc.sequencer.run_tables import has_run  # noqa: PLC0415  a trace needs no store
        from dsc.viewer.kept_runs import following_run  # noqa: PLC0415
        from dsc.viewer.stores import following_store  # noqa: PLC0415

        with (following_run if has_run(path) else following_store)(path) as log:
            yield log
    else:
        yield read_trace(path)
