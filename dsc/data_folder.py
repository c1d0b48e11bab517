"""Large data of a robot, e.g. pictures and laser scans, as files that short references name (S4.9, S2.20).

A reference such as `data:9f86d081884c7d65.png` is text: it fits in outcomes, parameters, facts and traces. Equal data
have equal references.
"""

from __future__ import annotations

import json
import math
import os
import re
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from dsc.errors import LostDataError
from knowledge_base.errors import InputError, StoreError
from knowledge_base.user_objects import described, shown

SCHEME = "data:"
"""Beginning of each reference."""
JSON = ".json"
"""Suffix of plain data."""
_NAME = re.compile(r"[0-9a-f]{16}\.[a-z0-9]{1,8}")
_SUFFIX = re.compile(r"\.[a-z0-9]{1,8}")
_MILLION = 1_000_000


class _Kept(NamedTuple):
    size: int
    at: float


class DataFolder:
    """A folder of data, usable from any thread; one program at a time should write to it.

    The oldest data are deleted when the folder exceeds one of its bounds.

    Args:
        folder: the folder, which is created with the first data.
        megabytes: the total size of the data, in millions of bytes.
        seconds: the age after which data are deleted.
        now: returns the time in seconds.

    Raises:
        InputError: a bound is not a positive number.
    """

    def __init__(
        self,
        folder: Path | str,
        megabytes: float = 1000.0,
        seconds: float = math.inf,
        now: Callable[[], float] = time.time,
    ) -> None:
        for what, bound in (("megabytes", megabytes), ("seconds", seconds)):
            if isinstance(bound, bool) or not isinstance(bound, int | float) or not bound > 0:
                raise InputError(f"`{what}` of a data folder is a positive number, not {shown(bound)}")
        self.folder = Path(folder)
        self._most, self._seconds, self._now = megabytes * _MILLION, seconds, now
        self._guard = threading.RLock()
        found = [(one.name, one.stat()) for one in self.folder.glob("*.*") if _NAME.fullmatch(one.name)]
        found.sort(key=lambda each: each[1].st_mtime)
        self._kept = {name: _Kept(file.st_size, file.st_mtime) for name, file in found}  # the oldest first
        self._size = sum(kept.size for kept in self._kept.values())

    def keep(self, data: Any, suffix: str = "") -> str:
        """Store data, and return their reference; equal data become new again, and damaged data whole.

        Args:
            data: bytes, or plain data such as a list of numbers.
            suffix: the suffix of the file, e.g. `.png`. Without it, bytes have `.bin`, and plain data `.json`.

        Raises:
            InputError: the data or the suffix have another form, or the data exceed the bound of the folder.
            StoreError: the file cannot be written.
        """
        is_bytes = isinstance(data, bytes | bytearray | memoryview)
        suffix = suffix or (".bin" if is_bytes else JSON)
        _require_suffix(suffix, is_bytes=is_bytes)
        content = bytes(data) if is_bytes else _json(data)
        if len(content) > self._most:
            message = f"data of {len(content) / _MILLION:,.1f} MB exceed the bound of {self.folder}"
            raise InputError(f"{message}, {self._most / _MILLION:,g} MB; give `megabytes=`")
        name = _digest(content) + suffix
        at = self._now()
        with self._guard:
            self._write(name, content, at)
            if self._kept.pop(name, None) is None:
                self._size += len(content)
            self._kept[name] = _Kept(len(content), at)  # the newest
            self._expire()
        return SCHEME + name

    def read(self, reference: str) -> Any:
        """Return the bytes of a reference, or for `.json` the plain data.

        Raises:
            InputError: the value is not a reference.
            LostDataError: the data were deleted, or the file was changed or cannot be read.
        """
        file = self.file(reference)
        try:
            content = file.read_bytes()
        except FileNotFoundError:
            raise self._absent(reference) from None
        except OSError as error:
            raise LostDataError(f"'{file}' cannot be read: {error.strerror or error}") from error
        if _digest(content) != file.stem:
            raise LostDataError(f"'{file}' was changed after it was written: its content has another digest")
        return json.loads(content) if file.suffix == JSON else content

    def file(self, reference: str) -> Path:
        """Return the file of a reference; raise as `read`."""
        name = name_in(reference)
        if name is None:
            raise InputError(f"{shown(reference)} is not a reference such as '{SCHEME}9f86d081884c7d65.png'")
        with self._guard:
            self._expire()
            if name not in self._kept and not (self.folder / name).exists():  # another program may have written it
                raise self._absent(reference)
        return self.folder / name

    def age(self, reference: str) -> float:
        """Return the seconds since the data were stored; raise as `read`."""
        file = self.file(reference)
        with self._guard:
            kept = self._kept.get(file.name)
        return self._now() - (file.stat().st_mtime if kept is None else kept.at)

    def release(self, reference: str) -> None:
        """Delete data before they exceed a bound; raise as `read`."""
        name = self.file(reference).name
        with self._guard:
            self._delete(name)

    def references(self) -> list[str]:
        """Return the references of the stored data, the oldest first."""
        with self._guard:
            self._expire()
            return [SCHEME + name for name in self._kept]

    def _write(self, name: str, content: bytes, at: float) -> None:
        """Write a file in such a way that a crash leaves no part of it under its name."""
        part = self.folder / f"{name}.part"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            part.write_bytes(content)
            os.utime(part, (at, at))
            part.replace(self.folder / name)
        except OSError as error:
            with suppress(OSError):
                part.unlink()
            raise StoreError(f"data cannot be written to {self.folder}: {error.strerror or error}") from error

    def _expire(self) -> None:
        """Delete the oldest data until the folder is within its bounds."""
        oldest = self._now() - self._seconds
        while self._kept:
            name, kept = next(iter(self._kept.items()))
            if self._size <= self._most and kept.at >= oldest:
                return
            self._delete(name)

    def _delete(self, name: str) -> None:
        kept = self._kept.pop(name, None)
        self._size -= kept.size if kept is not None else 0
        (self.folder / name).unlink(missing_ok=True)

    def _absent(self, reference: str) -> LostDataError:
        bounds = f"{self._most / _MILLION:,g} MB" + ("" if self._seconds == math.inf else f" and {self._seconds:g} s")
        message = f"there are no data '{reference}' in {self.folder}: they were released, or exceeded its bounds"
        return LostDataError(f"{message} ({bounds})")


def name_in(reference: object) -> str | None:
    """Return the name of the file of a reference; `None` for another value."""
    if not isinstance(reference, str) or not reference.startswith(SCHEME):
        return None
    name = reference.removeprefix(SCHEME)
    return name if _NAME.fullmatch(name) else None


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()[:16]


def _require_suffix(suffix: object, *, is_bytes: bool) -> None:
    if not isinstance(suffix, str) or not _SUFFIX.fullmatch(suffix):
        raise InputError(f"a suffix has up to eight small letters and digits, e.g. '.png', not {shown(suffix)}")
    if is_bytes is (suffix == JSON):
        kinds = "plain data have the suffix '.json', and bytes another one"
        raise InputError(f"{kinds}, not {shown(suffix)}")


def _json(data: Any) -> bytes:
    """Return plain data as JSON; equal data give equal bytes."""
    try:
        _require_text_keys(data)
        return json.dumps(data, separators=(",", ":"), allow_nan=False, sort_keys=True).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(
            f"data are bytes, or plain data such as a list of numbers: {described(error, named=False)}"
        ) from error


def _require_text_keys(data: Any) -> None:
    if isinstance(data, dict):
        for key in data:
            if not isinstance(key, str):
                raise TypeError(f"a key is a text, not {shown(key)}")
    for part in data.values() if isinstance(data, dict) else data if isinstance(data, list | tuple) else ():
        _require_text_keys(part)
