"""Files on disk, read again only after a change: an answer of an editor needs the texts of a whole project."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from knowledge_base.pddl.unsaved_texts import readable_text, unsaved_text

_SKIPPED = frozenset({"build", "dist", "node_modules", "site-packages", "__pycache__"})
_RECENT_NS = 2_000_000_000
"""Age from which a time of change counts: two changes within the resolution of a file system's times look alike."""


class _Stamp(NamedTuple):
    """The state of a file or folder on disk; another change has another stamp."""

    changed_ns: int
    size: int
    number: int


class _Folder(NamedTuple):
    """The folders and files directly inside a folder."""

    folders: tuple[str, ...]
    files: tuple[str, ...]


class Disk:
    """The texts and folders that were read, each valid until its time of change or size differs.

    A change that is less than two seconds old may be followed by another one with the same time. So what was read so
    soon after a change is read again.

    Args:
        now_ns: the present time in nanoseconds since 1970.
    """

    def __init__(self, now_ns: Callable[[], int] = time.time_ns) -> None:
        self._now_ns = now_ns
        self._texts: dict[str, tuple[_Stamp, str]] = {}
        self._folders: dict[str, tuple[_Stamp, _Folder]] = {}

    def text(self, file: Path) -> str:
        """Return the text of a file; nothing if it is not readable."""
        if (unsaved := unsaved_text(file)) is not None:
            return unsaved
        path = str(file)
        stamp, known = _stamp(path), self._texts.get(path)
        if known is not None and known[0] == stamp:
            return known[1]
        text = readable_text(file)
        if stamp is not None and self._is_settled(stamp):
            self._texts[path] = stamp, text
        return text

    def files_in(self, root: Path, endings: set[str] | frozenset[str]) -> Iterator[Path]:
        """Yield the files with these endings in a folder, without those of hidden folders and of builds."""
        waiting = [str(root)]
        while waiting:
            path = waiting.pop()
            inside = self._folder(path)
            waiting += [f"{path}{os.sep}{one}" for one in inside.folders]
            yield from (Path(path, one) for one in inside.files if f".{one.rpartition('.')[2]}" in endings)

    def _folder(self, path: str) -> _Folder:
        stamp, known = _stamp(path), self._folders.get(path)
        if known is not None and known[0] == stamp:
            return known[1]
        folders, files = list[str](), list[str]()
        try:
            with os.scandir(path) as entries:
                for one in entries:
                    if not one.is_dir():
                        files.append(one.name)
                    elif not one.is_symlink() and not one.name.startswith(".") and one.name not in _SKIPPED:
                        folders.append(one.name)
        except OSError:
            return _Folder((), ())
        found = _Folder(tuple(folders), tuple(files))
        if stamp is not None and self._is_settled(stamp):
            self._folders[path] = stamp, found
        return found

    def _is_settled(self, stamp: _Stamp) -> bool:
        return self._now_ns() - stamp.changed_ns > _RECENT_NS


def _stamp(path: str) -> _Stamp | None:
    try:
        found = Path(path).stat()
    except OSError:
        return None
    return _Stamp(found.st_mtime_ns, found.st_size, found.st_ino)
