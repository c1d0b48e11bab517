"""Checks of an executive's parts at run time, for callers without a type checker; each error is one line."""

from __future__ import annotations

from pathlib import Path

from knowledge_base.errors import InputError
from knowledge_base.language.checking.inputs import require, shown
from knowledge_base.store import KnowledgeBase


def require_parts(knowledge: object, planner: object, foresight: object, store: object) -> None:
    """Raise `InputError` unless each part has its declared type, or is `None`."""
    if knowledge is not None:
        require(knowledge, KnowledgeBase, "the knowledge is a KnowledgeBase")
    if store is not None:
        require(store, (str, Path), "a store is named by a text or a Path")
    _require_able(planner, "solve", "a planner")
    _require_able(foresight, "foresee", "a foresight")


def _require_able(part: object, method: str, what: str) -> None:
    if part is None:
        return
    if isinstance(part, type):
        raise InputError(f"{what} is an object, not a class; an instance is made by {part.__name__}()")
    if not callable(getattr(part, method, None)):
        raise InputError(f"{what} has a method '{method}', which {shown(part)[:60]} has not")
