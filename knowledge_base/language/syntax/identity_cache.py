"""Results for frozen values, by their identity.

Hashing a condition by its content walks all of it, which costs more than evaluating it. Conditions live as long as
their chart or text, so their identity suffices.
"""

from __future__ import annotations

from typing import Generic, TypeVar

_K = TypeVar("_K")
_V = TypeVar("_V")


class IdentityCache(Generic[_K, _V]):
    """At most `size` results by the identity of the two values they were made from.

    The values are kept alive with the result, so an identity is never taken for a later value's.
    """

    def __init__(self, size: int = 4096) -> None:
        self._size = size
        self._kept: dict[tuple[int, int], tuple[_K, object, _V]] = {}

    def find(self, key: _K, context: object) -> _V | None:
        """The result for `key` in `context`, if it is kept."""
        found = self._kept.get((id(key), id(context)))
        return None if found is None else found[2]

    def keep(self, key: _K, context: object, made: _V) -> _V:
        """Keep a result, and hand it back."""
        if len(self._kept) >= self._size:
            self._kept.clear()
        self._kept[id(key), id(context)] = (key, context, made)
        return made
