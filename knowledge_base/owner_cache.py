"""Results that hang on the value from which they follow: computed once, and gone with their owner."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, TypeVarTuple, Unpack


class Owner:
    """An immutable value, without slots, on which `cache_on_owner` keeps results."""

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for pickling and copying, without the results, which may contain locks."""
        return {name: value for name, value in vars(self).items() if "." not in name}


_Owner = TypeVar("_Owner", bound=Owner)
_Args = TypeVarTuple("_Args")
_T = TypeVar("_T")


def cache_on_owner(compute: Callable[[_Owner, Unpack[_Args]], _T]) -> Callable[[_Owner, Unpack[_Args]], _T]:
    """Return the function with its last result kept on its first argument.

    A call with other further arguments computes again, so that callers must not alternate between several of them.
    These arguments are immutable, too.
    """
    name = f"{compute.__module__}.{compute.__qualname__}"  # with a dot, which no field of the owner contains

    @wraps(compute)
    def find(owner: _Owner, *args: *_Args) -> _T:
        known: tuple[tuple[object, ...], _T] | None = vars(owner).get(name)
        if known is not None and known[0] == args:
            return known[1]
        result = compute(owner, *args)
        vars(owner)[name] = args, result
        return result

    return find
