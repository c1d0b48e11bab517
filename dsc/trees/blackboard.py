"""The blackboard: entries by key, one board for each tree, whose keys may be those of the outer tree."""

from __future__ import annotations

from collections.abc import Mapping

from dsc.trees.model import NO_TEXTS

EMPTY = object()
"""The value of an entry that a port declares, before the first value."""


class Entry:
    """A value that boards share; an entry that a port of integers names before any value is an integer."""

    __slots__ = ("integer", "value")

    def __init__(self) -> None:
        self.value: object = EMPTY
        self.integer = False


class Board:
    """The blackboard of one tree.

    Args:
        outer: the board of the tree with the `SubTree`; `None` for the main tree.
        keys: keys of the outer board by keys of this board.
        autoremap: whether the outer board has all other keys, except keys that begin with `_`.
    """

    def __init__(
        self, outer: Board | None = None, keys: Mapping[str, str] = NO_TEXTS, *, autoremap: bool = False
    ) -> None:
        self._outer = outer
        self._keys = keys
        self._autoremap = autoremap
        self.entries: dict[str, Entry] = {}

    def entry(self, key: str) -> Entry | None:
        """Return the entry of a key, or `None`; `@key` is a key of the main tree."""
        if key.startswith("@"):
            return self._main().entry(key[1:])
        if key in self.entries:
            return self.entries[key]
        outer = self._outer_key(key)
        return None if self._outer is None or outer is None else self._outer.entry(outer)

    def create(self, key: str) -> Entry:
        """Return the entry of a key; create it on the board to which the key belongs."""
        if key.startswith("@"):
            return self._main().create(key[1:])
        outer = self._outer_key(key)
        if key not in self.entries and self._outer is not None and outer is not None:
            return self._outer.create(outer)
        return self.entries.setdefault(key, Entry())

    def own(self, key: str, value: object) -> None:
        """Write a constant of a `SubTree`, which hides an equal key of the outer board."""
        self.entries[key] = entry = Entry()
        entry.value = value

    def remove(self, key: str) -> None:
        """Remove an entry of this board."""
        self.entries.pop(key, None)

    def _outer_key(self, key: str) -> str | None:
        if key in self._keys:
            return self._keys[key]
        return key if self._autoremap and not key.startswith("_") else None

    def _main(self) -> Board:
        board = self
        while board._outer is not None:
            board = board._outer
        return board
