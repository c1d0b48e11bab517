"""Text of expressions in a target language."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import reduce

from dsc.controllers.model import (
    Active,
    Combination,
    Comparison,
    Condition,
    Fixed,
    Kind,
    Operation,
    Opposite,
    Read,
    Value,
    may_fail,
)

SUFFIX = {"integer": "int", "number": "num", "boolean": "truth"}
"""Endings of the names of functions, by kind of data."""
_SIGNS = {"eq": "==", "lt": "<", "le": "<="}


class ExpressionText(ABC):
    """Writer of expressions; computations that cannot fail are plain operators."""

    words: tuple[str, str, str]
    """The operators for `and`, `or` and `not`."""

    @abstractmethod
    def constant(self, value: Fixed) -> str:
        """Return the text of a constant."""

    @abstractmethod
    def read(self, value: Read) -> str:
        """Return the text that reads a variable or attribute."""

    @abstractmethod
    def active(self, node: int) -> str:
        """Return the text of the condition that a node is active."""

    @abstractmethod
    def call(self, function: str, args: list[str]) -> str:
        """Return the text of a call of a function of the runtime."""

    def lift(self, text: str, _kind: Kind) -> str:
        """Return the text of a value that cannot fail as an argument of a function of the runtime."""
        return text

    def value(self, value: Value) -> str:
        """Return the text of a value; the value of an `Operation` may be a failure."""
        match value:
            case Fixed():
                return self.constant(value)
            case Read():
                return self.read(value)
            case Operation(function, args):
                return self.call(function, [self._lift_value(arg) for arg in args])

    def _lift_value(self, value: Value) -> str:
        text = self.value(value)
        return text if may_fail(value) else self.lift(text, value.kind)

    def condition(self, e: Condition) -> str:
        """Return the text of a condition; it is a truth value or, if it may fail, a failure."""
        return self._fallible(e) if may_fail(e) else self._plain(e)

    def _plain(self, e: Condition) -> str:
        both, either, opposite = self.words
        match e:
            case Fixed():
                return self.constant(e)
            case Active(node):
                return self.active(node)
            case Comparison(relation, left, right):
                return f"({self.value(left)} {_SIGNS[relation]} {self.value(right)})"
            case Opposite(body):
                return f"({opposite}{self.condition(body)})"
            case Combination(every, parts):
                texts = [self.condition(part) for part in parts] or [self.constant(Fixed(every, "boolean"))]
                return f"({f' {both if every else either} '.join(texts)})"

    def _fallible(self, e: Condition) -> str:
        match e:
            case Comparison(relation, left, right):
                return self.call(f"{relation}_{SUFFIX[left.kind]}", [self._lift_value(left), self._lift_value(right)])
            case Opposite(body):
                return self.call("opposite", [self.condition(body)])
            case Combination(every, parts):
                name = "both" if every else "either"
                return reduce(lambda a, b: self.call(name, [a, b]), map(self.condition, parts))
            case _:
                return self._plain(e)
