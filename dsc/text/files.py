"""Files that people wrote, read as UTF-8 and never further than anything readable is long."""

from __future__ import annotations

from pathlib import Path

from knowledge_base.errors import InputError, Place
from knowledge_base.language.inputs import shown

MAX_BYTES = 250_000
"""A hundred times the longest plot we ship; what is larger would keep its author waiting for an error."""


def read_file(path: Path | str) -> str:
    """The text of a file.

    Raises:
        InputError: it cannot be read, is not UTF-8, or has more than `MAX_BYTES`.
    """
    file = path_of(path)
    try:
        data = _bytes(file)
        return data.decode("utf-8")
    except FileNotFoundError:
        siblings = [str(other) for other in file.parent.glob("*")] if file.parent.is_dir() else []
        raise InputError(f"there is no file '{file}'", found=str(file), valid=siblings[:200]) from None
    except UnicodeDecodeError as error:
        before = data[: error.start]
        place = Place(str(file), before.count(b"\n") + 1, error.start - before.rfind(b"\n"))
        message = f"the file is not UTF-8: it cannot have the byte 0x{data[error.start]:02x} here"
        raise InputError(message, place=place) from None
    except OSError as error:
        raise InputError(f"cannot read the file: {error.strerror}", place=Place(str(file))) from None
    except ValueError as error:  # a NUL in the name
        raise InputError(f"this is no name of a file: {error}", found=str(file)) from None


def path_of(path: object) -> Path:
    """The path of that name; raises `InputError` for anything else than a text or path."""
    if not isinstance(path, str | Path):
        raise InputError(f"a file or folder is named by a text or a Path, not {shown(path)}")
    return Path(path)


def check_size(size: int, place: Place) -> None:
    """Raise `InputError` for a text of more than `MAX_BYTES`."""
    if size > MAX_BYTES:
        raise InputError(f"the text has {size} bytes; at most {MAX_BYTES} are read", place=place)


def _bytes(file: Path) -> bytes:
    place = Place(str(file))
    check_size(file.stat().st_size, place)
    with file.open("rb") as stream:  # a pipe or a device says 0 and may never end
        data = stream.read(MAX_BYTES + 1)
    check_size(len(data), place)
    return data
