"""Versions and times of a store's past, in command arguments."""

from __future__ import annotations

from datetime import datetime
from typing import TypedDict

from knowledge_base.errors import InputError

_MOST_DIGITS = 15
"""Maximum number of digits of a version: more than any store needs, and few enough to parse immediately."""


class Moment(TypedDict, total=False):
    """The arguments of `KnowledgeBase.at`: either of the two."""

    version: int
    time: float


def moment(text: str) -> Moment:
    """Return a version (`12`) or a time (ISO 8601; local without a time zone).

    Raises:
        InputError: the text is neither.
    """
    if text.isdecimal() and len(text) <= _MOST_DIGITS:
        return {"version": int(text)}
    try:
        return {"time": datetime.fromisoformat(text).timestamp()}
    except (ValueError, OverflowError, OSError):
        raise InputError(f"a moment is a version such as 12 or a time such as 2026-11-21T16:40, not '{text}'") from None
