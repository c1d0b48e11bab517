"""Typed expressions of a controller, made of conditions and terms of a plot; other forms are refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

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
)
from dsc.controllers.runtime.values import EXACT, INT64_MAX, INT64_MIN
from dsc.data_types import DataType
from dsc.engine.membership import IN_STATE
from knowledge_base.errors import Place
from knowledge_base.language.syntax import expression as lang
from knowledge_base.language.syntax.text import to_text

MOST_DOUBLE = 1.7976931348623157e308
"""The largest double."""
_NAMES = {"+": "add", "-": "sub", "*": "mul", "/": "div"}


class RefusedError(Exception):
    """A form that a controller cannot have; `place` is known if the form was read from a file."""

    def __init__(self, message: str, place: Place | None = None, found: str | None = None, valid: object = ()) -> None:
        super().__init__(message)
        self.message, self.place, self.found = message, place, found
        self.valid = tuple(map(str, valid)) if isinstance(valid, Mapping | list | tuple) else ()


def kind_of(wanted: DataType, subject: str) -> Kind:
    """Return the kind of a type of data; raise `RefusedError` if controllers have no such data."""
    if wanted.kind in {"integer", "number", "boolean"}:
        return wanted.kind
    raise RefusedError(f"{subject} has the type '{wanted}'; a controller has integers, numbers and booleans")


class Typing:
    """Converter of terms and conditions.

    Args:
        data: kinds of the variables that may be read.
        attributes: kinds of the attributes of events.
        states: node numbers of the states.
        checked: whether types are checked while the controller runs, as in dialect `dsc`.
    """

    def __init__(
        self, data: Mapping[str, Kind], attributes: Mapping[str, Kind], states: Mapping[str, int], *, checked: bool
    ) -> None:
        self.data, self.attributes, self.states, self.checked = data, attributes, states, checked

    # -- terms -------------------------------------------------------------------------------------------

    def value(self, term: lang.Term) -> Value:
        """Return a term as a typed value."""
        match term:
            case lang.Constant():
                return self._constant(term)
            case lang.Variable():
                return self._variable(term)
            case lang.Arithmetic("+" | "-" | "*" | "/", args):
                return self._arithmetic(term, [self._number(arg) for arg in args])
            case _:
                what = f"'{to_text(term)}' reads knowledge, or data other than numbers; a controller has neither"
                raise RefusedError(what, term.place)

    def _constant(self, term: lang.Constant) -> Value:
        match term.value:
            case bool():
                return Fixed(term.value, "boolean")
            case int():
                if not INT64_MIN <= term.value <= INT64_MAX:
                    raise RefusedError(f"{term.value} has more than 64 bits", term.place)
                return Fixed(term.value, "integer")
            case float():
                return Fixed(term.value, "number")
            case _:
                raise RefusedError(f"'{term.value}' is a name or text; a controller has only numbers", term.place)

    def _variable(self, term: lang.Variable) -> Value:
        name = term.name
        if name.startswith("event."):
            own = name.removeprefix("event.")
            if own in self.attributes:
                return Read("event", own, self.attributes[own])
            what = f"no event has a numeric attribute '{own}'; declare the attribute under `receives` with its type"
            raise RefusedError(what, term.place, own, self.attributes)
        if name in self.data:
            return Read("data", name, self.data[name])
        raise RefusedError(f"'?{name}' has no numeric value", term.place, name, self.data)

    def _number(self, term: lang.Term) -> Value:
        value = self.value(term)
        if value.kind == "boolean":
            raise RefusedError(f"'{to_text(term)}' is a truth value, not a number", term.place)
        return value

    def _arithmetic(self, term: lang.Arithmetic, values: list[Value]) -> Value:
        first, *rest = values
        if not rest:
            return Operation("neg_int" if first.kind == "integer" else "neg_num", (first,), first.kind)
        for value in rest:
            both = {first.kind, value.kind} == {"integer"} and term.operator != "/"
            kind: Kind = "integer" if both else "number"
            sides = (self.convert(first, kind), self.convert(value, kind))
            suffix = "int" if both else "num"
            first = Operation(f"{_NAMES[term.operator]}_{suffix}", sides, kind)
        return first

    def convert(self, value: Value, kind: Kind, place: Place | None = None) -> Value:
        """Return a value as one of another kind; raise `RefusedError` if the kinds do not fit."""
        if value.kind == kind:
            return value
        if "boolean" in {value.kind, kind}:
            raise RefusedError(f"a value of kind {value.kind} is given for one of kind {kind}", place)
        if kind == "number":
            if isinstance(value, Fixed) and abs(value.value) <= EXACT:
                return Fixed(float(value.value), "number")
            return Operation("widen", (value,), "number")
        if isinstance(value, Fixed) and float(value.value).is_integer() and abs(value.value) <= EXACT:
            return Fixed(int(value.value), "integer")
        if not self.checked:
            raise RefusedError("a number is given for an integer, and may have a fraction", place)
        return Operation("whole", (value,), "integer")

    def of_type(self, value: Value, wanted: DataType, place: Place | None = None) -> Value:
        """Return a value as one of a declared type, whose bounds are checked in dialect `dsc`."""
        value = self.convert(value, kind_of(wanted, "the value"), place)
        if not self.checked or (wanted.least is None and wanted.most is None):
            return value
        return bound(value, wanted.least, wanted.most)

    # -- conditions --------------------------------------------------------------------------------------

    def condition(self, e: lang.Expression) -> Condition:
        """Return a condition as a typed one."""
        match e:
            case lang.Atom(predicate, (lang.Constant(name),)) if predicate == IN_STATE:
                node = self.states.get(str(name))
                return Fixed(value=False, kind="boolean") if node is None else Active(node)
            case lang.Not(body):
                return Opposite(self.condition(body))
            case lang.And(parts):
                return Combination(every=True, parts=tuple(map(self.condition, parts)))
            case lang.Or(parts):
                return Combination(every=False, parts=tuple(map(self.condition, parts)))
            case lang.Imply(premise, conclusion):
                return Combination(every=False, parts=(Opposite(self.condition(premise)), self.condition(conclusion)))
            case lang.Comparison():
                return self._comparison(e)
            case _:
                what = f"'{to_text(e)}' is a condition on knowledge; a controller has no knowledge base"
                raise RefusedError(what, e.place)

    def _comparison(self, e: lang.Comparison) -> Condition:
        left, right = self.value(e.left), self.value(e.right)
        if "boolean" in {left.kind, right.kind}:
            if left.kind != right.kind or e.operator not in {"=", "!="}:
                raise RefusedError(f"'{to_text(e)}' compares a truth value with a number, or orders it", e.place)
            equal = Comparison("eq", left, right)
            return equal if e.operator == "=" else Opposite(equal)
        kind: Kind = "integer" if left.kind == right.kind == "integer" else "number"
        left, right = self.convert(left, kind), self.convert(right, kind)
        if e.operator in {">", ">="}:
            left, right = right, left
        relation: Literal["eq", "lt", "le"] = "eq"
        if e.operator not in {"=", "!="}:
            relation = "le" if "=" in e.operator else "lt"
        compared = Comparison(relation, left, right)
        return Opposite(compared) if e.operator == "!=" else compared


def bound(value: Value, least: float | None, most: float | None) -> Value:
    """Return a value that fails outside its bounds."""
    if value.kind == "integer":
        low, high = whole_bounds(least, most)
        return Operation("between_int", (value, Fixed(low, "integer"), Fixed(high, "integer")), "integer")
    low_num, high_num = number_bounds(least, most)
    return Operation("between_num", (value, Fixed(low_num, "number"), Fixed(high_num, "number")), "number")


def whole_bounds(least: float | None, most: float | None) -> tuple[int, int]:
    """Return the bounds of an integer of 64 bits."""
    low = INT64_MIN if least is None else max(INT64_MIN, math.ceil(least))
    return low, INT64_MAX if most is None else min(INT64_MAX, math.floor(most))


def number_bounds(least: float | None, most: float | None) -> tuple[float, float]:
    """Return the bounds of a finite double."""
    return -MOST_DOUBLE if least is None else float(least), MOST_DOUBLE if most is None else float(most)
