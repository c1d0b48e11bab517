"""Text files that people name: read, or refused with a message that helps."""

from __future__ import annotations

from pathlib import Path

from knowledge_base.errors import InputError, ParseError, Place


def read_text(path: Path, errors: str = "strict") -> str:
    """The text of a UTF-8 file; `errors` is what becomes of other bytes, as for `open`.

    Raises:
        InputError: there is no such file (the nearest file beside it is named), or it cannot be read.
        ParseError: it is not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig", errors=errors)
    except FileNotFoundError:
        raise InputError(f"there is no file '{path}'", found=path.name, valid=files_beside(path)) from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise ParseError("the file is not UTF-8 text", place=Place(str(path), line)) from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"cannot read '{path}': {reason}") from None


def text_and_source(text_or_path: str | Path, source: str | None) -> tuple[str, str | None]:
    """The text meant by a reader's argument, and the name to call it by in messages.

    A `Path` is a file. A string is PDDL text when it begins with `(` or `;` or has several lines, and the
    name of a file otherwise: no PDDL text of one line begins with anything else. What is not UTF-8 in a file
    comes as half characters, which are refused outside of comments (old files have authors' names there).
    """
    if isinstance(text_or_path, str) and ("\n" in text_or_path or text_or_path.lstrip()[:1] in ("", "(", ";")):
        return text_or_path, source
    path = Path(text_or_path)
    return read_text(path, errors="surrogateescape"), source or str(path)


def files_beside(path: Path) -> list[str]:
    """The names of the files with the same ending in the same folder: what may have been meant."""
    try:
        return [p.name for p in path.parent.iterdir() if p.suffix == path.suffix]
    except OSError:
        return []
