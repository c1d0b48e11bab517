"""What is handed in to a run where types are not checked: judged once, with one line of error."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from dsc.model.plot import ActionPlot
from knowledge_base.errors import InputError
from knowledge_base.language.inputs import shown


def require_seconds(after: object) -> None:
    """Raise `InputError` unless it is a time that passes."""
    if isinstance(after, bool) or not isinstance(after, int | float) or not math.isfinite(after):
        raise InputError(f"something comes after a finite number of seconds, not {shown(after)}")


def fitting(plot: ActionPlot, arguments: object) -> Mapping[str, Any]:
    """What somebody hands to a plot from outside, if it may be handed to it.

    Raises:
        InputError: it is no mapping, a value is no plain data, or a number or truth value is wanted and it is none.
    """
    if not isinstance(arguments, Mapping):
        raise InputError(f"arguments are a mapping of parameters' names to values, not {shown(arguments)}")
    for name, value in arguments.items():
        parameter = plot.parameters.get(name)
        if parameter is not None and parameter.type in {"number", "boolean"}:
            parameter.range.check(f"{plot.name}.{name}", value)
        try:
            json.dumps(value, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise InputError(f"the argument '{name}' is no plain data: {error}") from None
    return arguments
