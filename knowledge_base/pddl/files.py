"""Input files: read up to a maximum size, or refused with a helpful message.

All readers of texts use this module. A device or pipe is read like a file, up to the same size. A silent pipe is
refused, so that no reader waits indefinitely.
"""

from __future__ import annotations

import os
import select
import stat
import time
from collections.abc import Iterator
from pathlib import Path

from knowledge_base.errors import InputError, ParseError, Place
from knowledge_base.pddl.unsaved_texts import unsaved_text

MAX_BYTES = 16 * 1024 * 1024
"""Maximum size of a PDDL file in bytes: about a million facts.

A reader needs about 90 µs for each fact, and 100 bytes of memory for each byte of the file.
"""
WRITER_S = 3.0
"""Time in seconds to wait until a process writes into a pipe."""
SILENCE_S = 30.0
"""Maximum time in seconds without data from a pipe or terminal with a writer."""
_PIECE = 1 << 20
_LOOK_S = 0.02


def read_text(path: Path, errors: str = "strict", most: int | None = None) -> str:
    """Return the text of a UTF-8 file, without a byte order mark.

    Args:
        path: a file, device or pipe.
        errors: the handling of bytes that are not UTF-8, as for `open`.
        most: maximum number of bytes; the default is `MAX_BYTES`.

    Raises:
        InputError: the file is missing (the message suggests the nearest name in the folder), is unreadable or too
            long, or is a silent pipe.
        ParseError: the file is not UTF-8.
    """
    return decoded(read_bytes(path, MAX_BYTES if most is None else most), path, errors)


def read_bytes(path: Path, most: int) -> bytes:
    """Return the bytes of a file, device or pipe, at most `most` bytes; errors as for `read_text`."""
    return b"".join(_pieces(path, most))


def decoded(data: bytes, path: Path, errors: str = "strict") -> str:
    """Return the text of a file's bytes; raise `ParseError` as for `read_text`."""
    try:
        return data.decode("utf-8-sig", errors)
    except UnicodeDecodeError as error:
        raise _not_utf8(error, path) from None


def require_size(size: int, most: int, source: str | None) -> None:
    """Raise `InputError` if a text has more than `most` bytes."""
    if size > most:
        raise InputError(f"the text has {size} bytes; at most {most} are read", place=Place(source))


def read_lines(path: Path, most: int, longest: int, errors: str = "strict") -> Iterator[str]:
    """Yield the lines of a UTF-8 file without their line endings; an empty file has one empty line.

    Args:
        path: a file, device or pipe.
        most: maximum number of bytes of the file.
        longest: maximum number of bytes of a line.
        errors: the handling of bytes that are not UTF-8, as for `open`.

    Raises:
        InputError: as for `read_text`, or a line is too long.
        ParseError: a line is not UTF-8.
    """
    number, held, size = 0, list[bytes](), 0
    for piece in _pieces(path, most):
        begun, *more = piece.split(b"\n")
        held.append(begun)
        size += len(begun)
        for following in more:
            number += 1
            yield _line(b"".join(held), path, number, longest, errors)
            held, size = [following], len(following)
        if size > longest:  # further pieces only increase the size
            break
    if size or not number:
        yield _line(b"".join(held), path, number + 1, longest, errors)


def _pieces(path: Path, most: int) -> Iterator[bytes]:
    """Yield the bytes of a file, device or pipe in pieces; errors as for `read_text`."""
    unsaved = unsaved_text(path)
    if unsaved is not None:
        data = unsaved.encode("utf-8", "surrogatepass")
        require_size(len(data), most, str(path))
        yield data
        return
    try:
        # A blocking `open` of a pipe would wait for its writer.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
        try:
            about, total = os.fstat(handle), 0
            if stat.S_ISREG(about.st_mode):
                require_size(about.st_size, most, str(path))
            while piece := _piece(handle, path, min(_PIECE, most + 1 - total), begun=total > 0):
                total += len(piece)
                require_size(total, most, str(path))
                yield piece
        finally:
            os.close(handle)
    except FileNotFoundError:
        raise InputError(f"there is no file '{path}'", found=path.name, valid=neighbour_files(path)) from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise _unreadable(path, reason) from None


def _not_utf8(error: UnicodeDecodeError, path: Path, line: int = 1) -> ParseError:
    """Return the error for bytes that are not UTF-8; `line` is the line of the first byte."""
    before = error.object[: error.start]
    place = Place(str(path), line + before.count(b"\n"), error.start - before.rfind(b"\n"))
    message = f"the file is not UTF-8: it cannot have the byte 0x{error.object[error.start]:02x} here"
    return ParseError(message, place=place)


def text_and_source(text_or_path: str | Path, source: str | None) -> tuple[str, str | None]:
    """Return the text of a reader's argument, and the name of the text for messages.

    A `Path` is a file. A string is PDDL text if it begins with `(` or `;` or has several lines, else the name of a
    file. Bytes of a file that are not UTF-8 become surrogates. The parser refuses surrogates outside of comments: old
    files contain authors' names in comments.
    """
    if isinstance(text_or_path, str) and ("\n" in text_or_path or text_or_path.lstrip()[:1] in ("", "(", ";")):
        return text_or_path, source
    path = Path(text_or_path)
    return read_text(path, errors="surrogateescape"), source or str(path)


def neighbour_files(path: Path) -> list[str]:
    """Return the names of the files with the same ending in the same folder, as suggestions."""
    try:
        return [p.name for p in path.parent.iterdir() if p.suffix == path.suffix]
    except (OSError, ValueError):
        return []


def _piece(handle: int, path: Path, size: int, *, begun: bool) -> bytes:
    """Return the next bytes, at most `size`; empty at the end.

    A pipe without a writer is not at its end before its first bytes: a writer may still open the pipe.
    """
    patience = time.monotonic() + WRITER_S
    while True:
        try:
            piece = os.read(handle, size)
        except BlockingIOError:
            if not select.select([handle], [], [], SILENCE_S)[0]:
                raise _unreadable(path, f"nothing came for {SILENCE_S:g} s") from None
            continue
        if piece or begun or not stat.S_ISFIFO(os.fstat(handle).st_mode):
            return piece
        if time.monotonic() > patience:
            raise _unreadable(path, f"it is a pipe, and no process wrote into it for {WRITER_S:g} s")
        time.sleep(_LOOK_S)


def _line(data: bytes, path: Path, number: int, longest: int, errors: str) -> str:
    if len(data) > longest:
        raise InputError(f"a line has at most {longest} bytes", place=Place(str(path), number))
    try:
        return data.decode("utf-8-sig" if number == 1 else "utf-8", errors)
    except UnicodeDecodeError as error:
        raise _not_utf8(error, path, number) from None


def _unreadable(path: Path, reason: str | None) -> InputError:
    return InputError(f"cannot read the file: {reason}", place=Place(str(path)))
