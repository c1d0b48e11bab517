"""Frames: plain data as JSON, as it is sent to another process."""

from __future__ import annotations

import json
from typing import Any

from knowledge_base.errors import InputError
from knowledge_base.user_objects import described


def encoded(value: Any) -> bytes:
    """Return plain data as a frame; raise `InputError` for other data."""
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"only plain data can be sent: {described(error, named=False)}") from None
