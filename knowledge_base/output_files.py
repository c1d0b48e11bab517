"""Files that commands write: checked before a command begins, and written as a whole or not at all.

An output never replaces a store, a file that belongs to a store, or another file of the same command. The operating
system determines whether two names denote one file (links, `./x`, case). A regular file is replaced: a temporary file
in the same folder receives the complete text and the old mode, and is then renamed. A symbolic link leads to its
target; other hard links keep the old text. Pipes, terminals and open descriptors (`-`, `/dev/stdout`, `/dev/fd/3`, a
FIFO) are written in place, since their readers would not open a new file.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import stat
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from knowledge_base.errors import InputError
from knowledge_base.journal.sidecar_files import is_database, store_owning

STANDARD_OUTPUT = Path("-")
FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
"""Error numbers of a full or failing storage medium; another file name would not avoid these errors."""
PATIENCE_S = 5.0
"""Maximum time in seconds until a reader must open a FIFO."""

_LOOK_AGAIN_S = 0.02
_DESCRIPTORS = re.compile(r"/proc/(?P<process>\d+)(/task/\d+)?/fd")
_LOGS = {"-wal": (b"\x37\x7f\x06\x82", b"\x37\x7f\x06\x83"), "-journal": (b"\xd9\xd5\x05\xf9",)}
"""First bytes of SQLite's logs."""
_Identity = tuple[object, ...]


class Output:
    """A file that a command writes.

    Args:
        path: path of the file; `-` is standard output.
        option: the option or argument of the command that contains the path, for messages.
        others: the other files of the command; the output must differ from these files and from their sidecar files.
        over: first characters of a file that `stream` may empty; a file with other content is refused.

    Raises:
        InputError: the file cannot or must not be written; nothing was changed.
    """

    def __init__(self, path: Path | str, option: str, *others: Path | None, over: str | None = None) -> None:
        self.path = Path(path)
        self._option = option
        self._others = [other for other in others if other is not None]
        self._over = over
        self._check()

    def keep(self, *others: Path) -> None:
        """Raise `InputError` if the output is one of these files or of their sidecar files.

        The command needs these files too.
        """
        self._others += others
        self._check()

    def write(self, text: str) -> None:
        """Replace the content of the file by a text; errors as for `write_all`."""
        write_all({self: text})

    @contextmanager
    def stream(self) -> Iterator[TextIO]:
        """Open the file for a block and yield it as a text stream; each line is written immediately.

        A regular file is emptied, but not replaced: a present reader continues with the same file.

        Raises:
            InputError: as for the class, or another program streams to this file.
            OSError: the medium is full or fails.
        """
        self._check()
        if self.path == STANDARD_OUTPUT:
            yield sys.stdout
            return
        with self._report_errors():
            opened = self._special() if self._is_special() else self._open_emptied()
        with os.fdopen(opened, "w", encoding="utf-8", buffering=1) as stream:
            yield stream

    def refused(self, why: str) -> InputError:
        """Return the error with the reason why the file cannot be written."""
        return InputError(f"{self._option}: cannot write '{self.path}': {why}")

    def _check(self) -> None:
        if self.path == STANDARD_OUTPUT:
            return
        with self._report_errors():
            found = _status(self.path)
            if found is None or not stat.S_ISCHR(found.st_mode):  # a terminal can be read and written
                self._check_others()
            if found is None or stat.S_ISREG(found.st_mode):
                self._check_regular(found)
            elif (kind := _KINDS.get(stat.S_IFMT(found.st_mode))) is not None:
                raise self.refused(f"it is {kind}")

    def _check_regular(self, found: os.stat_result | None) -> None:
        stores = [other for other in self._others if _status(other) is None or is_database(other)]
        store = store_owning(self.path, stores) or _lost(_target(self.path))
        if store is not None:
            raise self.refused("it is a store" if store == _target(self.path) else f"it belongs to the store '{store}'")
        if (number := _descriptor(self.path)) is not None:
            if fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
                raise self.refused("it is open only to be read")
            return
        if self._over is not None and found is not None and found.st_size > 0 and not _begins(self.path, self._over):
            raise self.refused("it exists already and is not a file of that kind")
        folder = _target(self.path).parent
        if not folder.is_dir():
            raise self.refused(f"there is no folder '{folder}'")
        if not os.access(self.path if found is not None else folder, os.W_OK):
            raise self.refused("it may not be written")

    def _check_others(self) -> None:
        own = _identity(self.path)
        for other in self._others:
            if own == _identity(other):
                raise self.refused(f"the command needs '{other}' for something else")

    def _is_special(self) -> bool:
        """Return whether the file is written in place: a file that is not regular, or that is open already."""
        found = _status(self.path)
        return _descriptor(self.path) is not None or (found is not None and not stat.S_ISREG(found.st_mode))

    def _special(self) -> int:
        """Return a file descriptor of a file that cannot be replaced."""
        number = _descriptor(self.path)
        if number is not None:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            return os.dup(number)
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                opened = os.open(self.path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
            except OSError as error:
                if error.errno != errno.ENXIO or time.monotonic() >= end:
                    raise
                time.sleep(_LOOK_AGAIN_S)
            else:
                os.set_blocking(opened, True)
                return opened

    def _open_emptied(self) -> int:
        """Return a file descriptor of the emptied regular file, which no other stream uses."""
        opened = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            self._take(opened)
        except BaseException:
            os.close(opened)
            raise
        return opened

    def _take(self, opened: int) -> None:
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise self.refused("another program is writing it") from None
        except OSError:
            pass  # the file system has no locks
        begin = (self._over or "").encode()
        there = os.read(opened, len(begin))
        if there and there != begin:  # the file was created after the check
            raise self.refused("it exists already and is not a file of that kind")
        os.ftruncate(opened, 0)
        os.lseek(opened, 0, os.SEEK_SET)

    @contextmanager
    def _report_errors(self) -> Iterator[None]:
        """Convert errors about names and permissions into `InputError`.

        Errors of a medium are raised with the name of the file.
        """
        try:
            yield
        except (BrokenPipeError, InputError):
            raise
        except OSError as error:
            if error.errno in FULL:
                error.filename = str(self.path)
                raise
            why = "it has no reader" if error.errno == errno.ENXIO else str(error.strerror)
            raise self.refused(why) from None
        except ValueError as error:  # a null character in the name
            raise self.refused(str(error)) from None


def write_all(texts: Mapping[Output, str]) -> None:
    """Replace the contents of all outputs by the texts.

    If an error occurs before all texts are complete, no content is changed.

    Raises:
        InputError: a text cannot be encoded as UTF-8, or a file cannot be written.
        OSError: the medium is full or fails.
    """
    complete = {output: _encode(output, text) for output, text in texts.items()}
    beside: dict[Output, Path] = {}
    try:
        for output, data in complete.items():
            output._check()  # noqa: SLF001  another program may have created the file after the first check
            if output.path != STANDARD_OUTPUT and not output._is_special():  # noqa: SLF001
                _stage(output, data, beside)
        for output, data in complete.items():
            with output._report_errors():  # noqa: SLF001
                if output in beside:
                    beside[output].replace(_target(output.path))
                    del beside[output]
                elif output.path == STANDARD_OUTPUT:
                    sys.stdout.write(texts[output])
                    sys.stdout.flush()
                else:
                    with os.fdopen(output._special(), "wb") as stream:  # noqa: SLF001
                        stream.write(data)
    finally:
        for file in beside.values():
            file.unlink(missing_ok=True)


def _encode(output: Output, text: str) -> bytes:
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError as error:
        half = error.object[error.start : error.end]
        raise output.refused(f"UTF-8 has nothing for {half!a}") from None


def _stage(output: Output, data: bytes, beside: dict[Output, Path]) -> None:
    """Write the text to a temporary file in the folder of the output."""
    target = _target(output.path)
    file = target.with_name(f".dsc-{os.urandom(8).hex()}.tmp")
    with output._report_errors():  # noqa: SLF001
        opened = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        beside[output] = file
        with os.fdopen(opened, "wb") as stream:
            if (old := _status(target)) is not None:
                with suppress(OSError):  # only root may change the owner of a file
                    os.fchown(opened, old.st_uid, old.st_gid)
                os.fchmod(opened, stat.S_IMODE(old.st_mode))
            stream.write(data)
            stream.flush()
            os.fsync(opened)


def _status(path: Path) -> os.stat_result | None:
    """Return the status of the file that the name leads to; `None` if the file is missing."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _target(path: Path) -> Path:
    """Return the path of the file that the name leads to, through all links."""
    return Path(os.path.realpath(path))


def _identity(path: Path) -> _Identity:
    """Return equal values for two names of one file.

    For a missing file, the result contains the values of its folder, and its name.
    """
    try:
        found = _status(path)
        if found is not None:
            return found.st_dev, found.st_ino
        target = _target(path)
        folder = target.parent.stat()
    except (OSError, ValueError):
        return (str(path),)
    return folder.st_dev, folder.st_ino, target.name


def _descriptor(path: Path) -> int | None:
    """Return the number of the open file that a name such as `/dev/stdout` denotes; `None` for other names."""
    for _ in range(8):  # links to links
        folder = _DESCRIPTORS.fullmatch(os.path.realpath(path.parent))
        if folder is not None and path.name.isdecimal():
            return int(path.name) if int(folder["process"]) == os.getpid() else None
        if not path.is_symlink():
            return None
        path = path.parent / path.readlink()
    return None


def _lost(path: Path) -> Path | None:
    """Return the store whose own file is empty or missing, if `path` is this file or the log of the store.

    The log may contain all data of the store.
    """
    for end, begins in _LOGS.items():
        log = path if path.name.endswith(end) else path.with_name(path.name + end)
        if any(_begins(log, begin) for begin in begins):
            return log.with_name(log.name.removesuffix(end))
    return None


def _begins(path: Path, begin: bytes | str) -> bool:
    """Return whether the path is a regular file that begins with `begin`.

    A caller must not use this function for stores: closing a store's file releases SQLite's locks.
    """
    wanted = begin.encode() if isinstance(begin, str) else begin
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # to read other files could block
            return False
        with path.open("rb") as file:
            return file.read(len(wanted)) == wanted
    except OSError:
        return False


_KINDS = {stat.S_IFDIR: "a folder", stat.S_IFBLK: "a disk", stat.S_IFSOCK: "a socket"}
"""Kinds of files that are never written, with their names in messages."""
