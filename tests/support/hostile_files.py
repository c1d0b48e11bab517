"""Things that are no store, at places where one is expected, and what a folder looked like before."""

from __future__ import annotations

import os
import socket
import sqlite3
import stat
from collections.abc import Callable
from pathlib import Path


def _socket(path: Path) -> None:
    """Made in its folder: the name of a socket has at most 107 bytes."""
    here = Path.cwd()
    os.chdir(path.parent)
    try:
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(path.name)
    finally:
        os.chdir(here)


def _database(path: Path) -> None:
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("CREATE TABLE world (state TEXT)")
    connection.execute("INSERT INTO world VALUES ('mine')")
    connection.close()


def _to_a_text(path: Path) -> None:
    path.with_name("notes").write_text("mine\n")
    path.symlink_to("notes")


def _to_a_pipe(path: Path) -> None:
    os.mkfifo(path.with_name("elsewhere"))
    path.symlink_to("elsewhere")


STRANGERS: dict[str, Callable[[Path], object]] = {
    "text": lambda path: path.write_text("my own notes\n", encoding="utf-8"),
    "numbers": lambda path: path.write_text("4711\n", encoding="utf-8"),
    "database": _database,
    "folder": lambda path: path.mkdir(),
    "pipe": os.mkfifo,
    "socket": _socket,
    "device": lambda path: os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 3)),  # like /dev/null
    "link to a pipe": _to_a_pipe,
    "dangling link": lambda path: path.symlink_to("nowhere"),
    "circular link": lambda path: path.symlink_to(path.name),
}
LINKS_TO_TEXT: dict[str, Callable[[Path], object]] = {
    "link": _to_a_text,
}


def picture(folder: Path) -> dict[str, tuple[int, bytes | str]]:
    """Each file with its kind and content; nothing is waited for, and no link followed."""
    found: dict[str, tuple[int, bytes | str]] = {}
    for path in sorted(folder.rglob("*")):
        mode = path.lstat().st_mode
        content: bytes | str = b""
        if stat.S_ISLNK(mode):
            content = str(path.readlink())
        elif stat.S_ISREG(mode):
            content = path.read_bytes()
        found[str(path.relative_to(folder))] = (mode, content)
    return found
