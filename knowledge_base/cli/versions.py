"""Moments of a store's past, as people write them."""

from __future__ import annotations

from datetime import datetime
from typing import TypedDict

from knowledge_base.errors import InputError

_MOST_DIGITS = 15
"""Of a version: more than any store has, and no more than are read in no time."""


class Moment(TypedDict, total=False):
    """What `KnowledgeBase.at` takes: one of the two."""

    version: int
    time: float


def moment(text: str) -> Moment:
    """A version (`12`) or a time (ISO 8601; without a time zone it is local).

    Raises:
        InputError: it is neither.
    """
    if text.isdecimal() and len(text) <= _MOST_DIGITS:
        return {"version": int(text)}
    try:
        return {"time": datetime.fromisoformat(text).timestamp()}
    except (ValueError, OverflowError, OSError):
        raise InputError(f"a moment is a version such as 12 or a time such as 2026-11-21T16:40, not '{text}'") from None
