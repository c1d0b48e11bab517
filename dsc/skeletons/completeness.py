"""Requirement of generated projects: each class of a component has all methods that the plots use."""

from __future__ import annotations

import inspect
from collections.abc import Sequence

from knowledge_base.errors import InputError, Place, tolerated


def require_complete(*classes: type[object]) -> None:
    """Raise `InputError` for a class that lacks a method of its generated base; `dsc check` reports all of them."""
    incomplete = [one for one in classes if inspect.isabstract(one)]
    for one in incomplete[:-1]:
        with tolerated():
            raise _error(one)
    if incomplete:
        raise _error(incomplete[-1])


def _error(kind: type[object]) -> InputError:
    missing: Sequence[str] = sorted(getattr(kind, "__abstractmethods__", ()))
    line = inspect.getsourcelines(kind)[1]
    names = ", ".join(f"'{one}'" for one in missing)
    return InputError(
        f"the class {kind.__name__} lacks {names}, which the plots use; its base class has the declarations",
        place=Place(inspect.getsourcefile(kind), line),
        found=missing[0],
    )
