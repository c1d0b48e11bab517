"""Cache of results for immutable values, by their identity.

The hash of a condition's content requires a walk through the whole condition, which costs more than its evaluation. A
condition exists as long as its chart or text, so that its identity suffices as a key.
"""

from __future__ import annotations

from typing import Generic, TypeVar

_K = TypeVar("_K")
_V = TypeVar("_V")


class IdentityCache(Generic[_K, _V]):
    """At most `size` results, by the identity of a key and a context.

    The cache keeps the key and the context alive, so that no later value can have the same identity.
    """

    def __init__(self, size: int = 4096) -> None:
        self._size = size
        self._kept: dict[tuple[int, int], tuple[_K, object, _V]] = {}

    def find(self, key: _K, context: object) -> _V | None:
        """Return the result for `key` in `context`, or `None`."""
        found = self._kept.get((id(key), id(context)))
        return None if found is None else found[2]

    def keep(self, key: _K, context: object, made: _V) -> _V:
        """Store a result and return it."""
        if len(self._kept) >= self._size:
            self._kept.clear()
        self._kept[id(key), id(context)] = (key, context, made)
        return made
