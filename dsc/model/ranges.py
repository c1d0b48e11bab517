"""Ranges of parameters, and the roles that may set a parameter (S1.11).

The builder of a plot or component declares the range, and the integrator declares the default.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

from knowledge_base.errors import InputError, SchemaError
from knowledge_base.facts import Value

Who = Literal["nobody", "profile", "operator", "rules", "plots"]
_RANKS: tuple[Who, ...] = ("nobody", "profile", "operator", "rules", "plots")


def may_change(who: Who, changed_by: Who) -> bool:
    """Return whether the role `who` may set a value; `changed_by` is the last permitted role in the order of roles."""
    return _RANKS.index(who) <= _RANKS.index(changed_by)


def refuse_change(name: str, who: Who, changed_by: Who) -> None:
    """Raise `SchemaError` if `who` may not change the parameter of that name."""
    if not may_change(who, changed_by):
        raise SchemaError(f"'{name}' is not changed by {who}, but by {changed_by}", found=name)


@dataclass(frozen=True, slots=True)
class Range:
    """The allowed values of a parameter.

    Attributes:
        type: `number` or `boolean`; every other type has words as values.
        least, most: lower and upper bound of a number, inclusive; `None` means no bound.
        among: the allowed values; empty means any.
        whole: whether the numbers are integers.
    """

    type: str
    least: float | None = None
    most: float | None = None
    among: tuple[Value, ...] = ()
    whole: bool = False

    def __str__(self) -> str:
        """Return the range in words, for messages."""
        if self.among:
            return "one of " + ", ".join(map(written, self.among))
        bounds = self._bounds()
        if self.whole:
            return f"an integer {bounds}".rstrip()
        return bounds or f"{'an' if self.type[:1] in 'aeiou' else 'a'} {self.type}"

    def _bounds(self) -> str:
        if self.least is not None and self.most is not None:
            return f"from {self.least:g} to {self.most:g}"
        if self.least is not None:
            return f"{self.least:g} or more"
        return "" if self.most is None else f"{self.most:g} or less"

    def check(self, name: str, value: object) -> Value:
        """Return the value if the range contains it.

        Args:
            name: name of the parameter, for messages.
            value: new value of the parameter.

        Raises:
            InputError: the value is of another type or out of range; the message has the range and the nearest word.
        """
        if isinstance(value, str | int | float | bool) and self._fits(value):
            return int(value) if self.whole else value
        message = f"'{name}' is {self}; found {written(value)}"
        if self.type == "number" and not self.among and isinstance(value, str | bool):
            kind = "the text" if isinstance(value, str) else "the truth value"
            message = (
                f"'{name}' is a number{'' if str(self) == 'a number' else f', {self}'}; found {kind} {written(value)}"
            )
        raise InputError(message, found=str(value), valid=map(str, self.among))

    def read(self, name: str, text: str) -> Value:
        """Return the value that a text states, e.g. `2.5`, `true` or `kitchen`.

        Args:
            name: name of the parameter, for messages.
            text: the text of a value.

        Raises:
            InputError: the text is not a value of the type, or is out of range; the message has the range.
        """
        value: Value = text
        if self.type == "boolean":
            value = {"true": True, "false": False}.get(text, text)
        elif self.type == "number":
            with suppress(ValueError):
                value = int(text) if text.lstrip("+-").isdecimal() else float(text)
        return self.check(name, value)

    def problems(self) -> Iterable[str]:
        """Yield a message for each contradiction between the range's fields; empty for a valid range."""
        if self.type != "number" and (self.least is not None or self.most is not None):
            yield f"`least` and `most` are about numbers, and this is a {self.type}"
        elif self.least is not None and self.most is not None and self.least > self.most:
            yield f"no number is {self.least:g} or more and {self.most:g} or less"
        for value in self.among:
            if kind_of(value) != self._kind:
                yield f"{written(value)} is no {self.type}"

    @property
    def _kind(self) -> str:
        return self.type if self.type in {"number", "boolean"} else "word"

    def _fits(self, value: Value) -> bool:
        if kind_of(value) != self._kind or (self.among and value not in self.among):
            return False
        if isinstance(value, float) and math.isnan(value):  # every comparison with NaN is false
            return False
        if self.whole and float(value) % 1:
            return False
        too_low = self.least is not None and not isinstance(value, str) and value < self.least
        too_high = self.most is not None and not isinstance(value, str) and value > self.most
        return not (too_low or too_high)


def kind_of(value: Value) -> str:
    """Return the kind of a value: `number`, `boolean` or `word`."""
    return "boolean" if isinstance(value, bool) else "word" if isinstance(value, str) else "number"


def written(value: object) -> str:
    """Return the text of a value as it is written in a file."""
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)
