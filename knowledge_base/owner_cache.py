"""Results that hang on the value from which they follow: computed once, and gone with their owner."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

_Owner = TypeVar("_Owner")
_P = ParamSpec("_P")
_T = TypeVar("_T")


def cache_on_owner(compute: Callable[Concatenate[_Owner, _P], _T]) -> Callable[Concatenate[_Owner, _P], _T]:
    """Return the function with its last result kept on its first argument, an immutable object with a `__dict__`.

    A call with other further arguments computes again; these arguments are immutable, too, and positional.
    """
    name = f"{compute.__module__}.{compute.__qualname__}"  # no field of the owner contains a dot

    @wraps(compute)
    def find(owner: _Owner, /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        known: tuple[tuple[object, ...], _T] | None = vars(owner).get(name)
        if known is not None and known[0] == args:
            return known[1]
        result = compute(owner, *args, **kwargs)
        vars(owner)[name] = args, result
        return result

    return find
