"""Unsaved texts: the texts of an editor's buffers, which readers use in place of the files on disk (S1.16)."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_unsaved: ContextVar[Mapping[str, str]] = ContextVar("unsaved", default={})  # noqa: B039  never changed


@contextmanager
def unsaved_texts(texts: Mapping[Path, str]) -> Iterator[None]:
    """Let all readers of the block use these texts in place of the files; other files are read from disk.

    Args:
        texts: the text of each file; a file that does not exist on disk stays invisible for searches in folders.
    """
    token = _unsaved.set({os.path.realpath(file): text for file, text in texts.items()})
    try:
        yield
    finally:
        _unsaved.reset(token)


def readable_text(file: Path) -> str:
    """Return the unsaved text of a file, else its text on disk; nothing if it is not readable."""
    unsaved = unsaved_text(file)
    try:
        return file.read_text("utf-8") if unsaved is None else unsaved
    except (OSError, UnicodeDecodeError):
        return ""


def unsaved_text(file: Path) -> str | None:
    """Return the unsaved text of a file; `None` if the file on disk is valid."""
    texts = _unsaved.get()
    return texts.get(os.path.realpath(file)) if texts else None
