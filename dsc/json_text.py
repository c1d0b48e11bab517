"""JSON encoders that are made once for all values: `JSONEncoder.encode` makes half of itself anew for each."""

from __future__ import annotations

import json
import json.encoder
from collections.abc import Callable
from typing import Any


def text_by(encoder: json.JSONEncoder) -> Callable[[Any], str]:
    """What the encoder's `encode` gives, of plain data without indentation, for less than half.

    The data must not contain itself, which is not looked for.
    """
    make: Callable[..., Any] | None = getattr(json.encoder, "c_make_encoder", None)
    if make is None:  # a Python without it
        return encoder.encode
    basestring = json.encoder.encode_basestring_ascii if encoder.ensure_ascii else json.encoder.encode_basestring
    chunks = make(
        None, encoder.default, basestring, None, encoder.key_separator, encoder.item_separator, encoder.sort_keys,
        encoder.skipkeys, encoder.allow_nan,
    )  # fmt: skip
    return lambda value: "".join(chunks(value, 0))
