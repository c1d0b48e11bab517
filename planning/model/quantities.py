"""Ground numeric expressions (PDDL 2.1, level 2): residuals of terms after partial evaluation."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from knowledge_base.errors import SchemaError
from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.world_protocol import World


@dataclass(frozen=True, slots=True)
class Operation:
    """An arithmetic operation `+ - * /` on quantities; `-` with one argument negates it."""

    operator: str
    args: tuple[Quantity, ...]


Quantity = float | Fact | Operation
"""A number, a ground numeric fluent (written as a `Fact`), or an operation on quantities."""

Numbers = Mapping[Fact, float]

_COMPUTE: Mapping[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
_COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "=": operator.eq,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
OPPOSITE = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
"""The complement of each comparison operator."""


@dataclass(frozen=True, slots=True)
class NumericBound:
    """A comparison of two quantities; the operator is one of `= < <= > >=`."""

    operator: str
    left: Quantity
    right: Quantity

    def holds(self, numbers: Numbers) -> bool:
        """Return whether the comparison is true; a comparison with a division by zero is false.

        The value of a fluent without an entry in `numbers` is 0.
        """
        try:
            return _COMPARE[self.operator](value(self.left, numbers), value(self.right, numbers))
        except ArithmeticError:
            return False

    def fluents(self) -> Iterator[Fact]:
        """Yield the numeric fluents of the comparison."""
        yield from fluents(self.left)
        yield from fluents(self.right)

    def __str__(self) -> str:
        """Return the comparison in PDDL, e.g. `(> (fuel truck1) 3)`."""
        return f"({self.operator} {text(self.left)} {text(self.right)})"


@dataclass(frozen=True, slots=True)
class Assignment:
    """A ground numeric effect, which sets `fluent` to `amount`, or with `increase` adds `amount` to `fluent`."""

    fluent: Fact
    amount: Quantity
    increase: bool

    def result(self, numbers: Numbers) -> float:
        """Return the value of the fluent after the effect.

        Raises:
            ArithmeticError: the value cannot be computed.
        """
        amount = value(self.amount, numbers)
        return numbers.get(self.fluent, 0.0) + amount if self.increase else amount


def helps(change: Assignment, bound: NumericBound) -> bool:
    """Return whether a change may make a bound true that is now false. `False` is certain; `True` means "possibly"."""
    if not change.increase or isinstance(change.amount, Fact | Operation) or bound.operator == "=":
        return True
    slopes = linear(Operation("-", (bound.left, bound.right)))
    if slopes is None:
        return True
    gain = slopes.get(change.fluent, 0.0) * change.amount
    return gain > 0 if bound.operator in {">", ">="} else gain < 0


def value(quantity: Quantity, numbers: Numbers) -> float:
    """Return the value of the quantity.

    Raises:
        ArithmeticError: a division by zero, or a result out of range.
    """
    match quantity:
        case Fact():
            return numbers.get(quantity, 0.0)
        case Operation(name, args):
            first, *rest = (value(arg, numbers) for arg in args)
            if not rest:
                return -first
            for number in rest:
                first = _COMPUTE[name](first, number)
            return first
        case _:
            return quantity


def combined(name: str, args: tuple[Quantity, ...]) -> Quantity:
    """Return the operation on quantities, computed if all of them are numbers.

    Raises:
        ArithmeticError: a division by zero.
    """
    whole = Operation(name, args)
    return whole if any(isinstance(arg, Fact | Operation) for arg in args) else value(whole, {})


def fluents(quantity: Quantity) -> Iterator[Fact]:
    """Yield the numeric fluents in a quantity."""
    match quantity:
        case Fact():
            yield quantity
        case Operation(_, args):
            for arg in args:
                yield from fluents(arg)
        case float() | int():
            pass


def linear(quantity: Quantity) -> dict[Fact, float] | None:
    """Return the coefficients of a linear sum of fluents, without constants; `None` if the quantity is not linear."""
    match quantity:
        case Fact():
            return {quantity: 1.0}
        case Operation("+" | "-" as name, args):
            return _sum(name, args)
        case Operation("*", args):
            numbers = [arg for arg in args if not isinstance(arg, Fact | Operation)]
            others = [arg for arg in args if isinstance(arg, Fact | Operation)]
            return _scale(linear(others[0]), _product(numbers)) if len(others) == 1 else None
        case Operation("/", (dividend, float() | int() as divisor)):
            return _scale(linear(dividend), 1 / divisor) if divisor else None
        case Operation():
            return None
        case _:
            return {}


def _sum(name: str, args: tuple[Quantity, ...]) -> dict[Fact, float] | None:
    signs = [1.0 if name == "+" or (i == 0 and len(args) > 1) else -1.0 for i in range(len(args))]
    total: dict[Fact, float] = {}
    for sign, arg in zip(signs, args, strict=True):
        part = linear(arg)
        if part is None:
            return None
        for fluent, coefficient in part.items():
            total[fluent] = total.get(fluent, 0.0) + sign * coefficient
    return total


def _product(numbers: list[float]) -> float:
    product = 1.0
    for number in numbers:
        product *= number
    return product


def _scale(part: dict[Fact, float] | None, factor: float) -> dict[Fact, float] | None:
    return None if part is None else {fluent: factor * coefficient for fluent, coefficient in part.items()}


def text(quantity: Quantity) -> str:
    """Return the quantity in PDDL, e.g. `(+ (fuel truck1) 3)`."""
    match quantity:
        case Fact():
            return str(quantity)
        case Operation(name, args):
            return f"({name} {' '.join(map(text, args))})"
        case _:
            return f"{quantity:g}"


def to_json(quantity: Quantity) -> Any:
    """Return the quantity as JSON data: a number, `{"fluent": [NAME, ARG, ...]}` or `[OPERATOR, ARG, ...]`."""
    match quantity:
        case Fact(name, args):
            return {"fluent": [name, *args]}
        case Operation(name, args):
            return [name, *map(to_json, args)]
        case _:
            return quantity


def from_json(data: Any) -> Quantity:
    """Return the quantity that `to_json` wrote as `data`."""
    match data:
        case {"fluent": [str() as name, *args]}:
            return Fact(name, tuple(args))
        case [str() as name, *args]:
            return Operation(name, tuple(map(from_json, args)))
        case _:
            return float(data) if isinstance(data, float) else int(data)


def value_of(world: World, fluent: Fact) -> float:
    """Return the value of a numeric fluent in the world.

    Raises:
        SchemaError: the value is not a number.
    """
    content = world.value(fluent.predicate, fluent.args)
    if not isinstance(content, int | float):
        raise SchemaError(f"{fluent} is not a number")
    return content
