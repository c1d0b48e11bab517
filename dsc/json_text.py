"""JSON text of plain data, as traces and stores keep it: the library's writer takes a third of the time of `json`."""

from __future__ import annotations

import json
from typing import Any

from pydantic_core import PydanticSerializationError, to_json


def text_of(value: Any) -> str:
    """JSON without spaces, on one line; numbers that JSON lacks (`Infinity`) are written as Python reads them.

    Raises:
        TypeError: something in it is no plain data.
        RecursionError: it is nested too deeply.
    """
    try:
        return to_json(value, inf_nan_mode="constants").decode()
    except PydanticSerializationError:  # half a character, which no encoding has; or nested more than 255 times
        return json.dumps(value, separators=(",", ":"))
