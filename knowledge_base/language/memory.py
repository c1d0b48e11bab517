"""Remembering what was worked out about frozen values, by their identity.

Hashing a condition by its content walks all of it, which costs more than evaluating it; conditions live as
long as the chart or text they belong to, so their identity is enough.
"""

from __future__ import annotations

from collections.abc import Callable
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

    def get(self, key: _K, context: object, make: Callable[[], _V]) -> _V:
        """The result for `key` in `context`, made when it is first asked for."""
        identity = (id(key), id(context))
        found = self._kept.get(identity)
        if found is not None:
            return found[2]
        made = make()
        if len(self._kept) >= self._size:
            self._kept.clear()
        self._kept[identity] = (key, context, made)
        return made
