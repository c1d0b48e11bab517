"""Arithmetic, comparisons and logic of controllers, where a computation may fail; part of each Python controller."""

from __future__ import annotations

import math

INT64_MIN, INT64_MAX = -(2**63), 2**63 - 1
EXACT = 2**53
"""The largest integer up to which each integer is a double."""


class Failure:
    """A computation without a result; `ERROR` and `OVERFLOW` are the only two."""


ERROR, OVERFLOW = Failure(), Failure()
Number = float | Failure
Truth = bool | Failure


def fits(value: object, kind: type) -> bool:
    """Return whether a value is of a kind of data: `bool`, `int` of 64 bits, or `float`."""
    if kind is bool or isinstance(value, bool):
        return kind is bool and isinstance(value, bool)
    if kind is int:
        return isinstance(value, int) and INT64_MIN <= value <= INT64_MAX
    return isinstance(value, int | float)


def widen(value: int | Failure) -> Number:
    """Return an integer as a double."""
    if isinstance(value, Failure):
        return value
    return float(value) if -EXACT <= value <= EXACT else OVERFLOW


def whole(value: Number) -> int | Failure:
    """Return a double as an integer."""
    if isinstance(value, Failure):
        return value
    if not value.is_integer():
        return ERROR
    return _check_range(int(value))


def _check_range(value: int) -> int | Failure:
    return value if INT64_MIN <= value <= INT64_MAX else OVERFLOW


def add_int(a: int | Failure, b: int | Failure) -> int | Failure:
    """Return the sum of two integers."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else _check_range(a + b)


def sub_int(a: int | Failure, b: int | Failure) -> int | Failure:
    """Return the difference of two integers."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else _check_range(a - b)


def mul_int(a: int | Failure, b: int | Failure) -> int | Failure:
    """Return the product of two integers."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else _check_range(a * b)


def neg_int(a: int | Failure) -> int | Failure:
    """Return the negative of an integer."""
    return a if isinstance(a, Failure) else _check_range(-a)


def _finite(value: float) -> Number:
    return value if math.isfinite(value) else ERROR


def add_num(a: Number, b: Number) -> Number:
    """Return the sum of two numbers."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else _finite(a + b)


def sub_num(a: Number, b: Number) -> Number:
    """Return the difference of two numbers."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else _finite(a - b)


def mul_num(a: Number, b: Number) -> Number:
    """Return the product of two numbers."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else _finite(a * b)


def div_num(a: Number, b: Number) -> Number:
    """Return the quotient of two numbers."""
    if isinstance(a, Failure):
        return a
    if isinstance(b, Failure):
        return b
    return ERROR if b == 0 else _finite(a / b)


def neg_num(a: Number) -> Number:
    """Return the negative of a number."""
    return a if isinstance(a, Failure) else -a


def between_int(value: int | Failure, least: int, most: int) -> int | Failure:
    """Return an integer within its bounds."""
    return value if isinstance(value, Failure) or least <= value <= most else ERROR


def between_num(value: Number, least: float, most: float) -> Number:
    """Return a number within its bounds."""
    return value if isinstance(value, Failure) or least <= value <= most else ERROR


def eq(a: Number, b: Number) -> Truth:
    """Return whether two numbers are equal."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else a == b


def lt(a: Number, b: Number) -> Truth:
    """Return whether the first number is less."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else a < b


def le(a: Number, b: Number) -> Truth:
    """Return whether the first number is less or equal."""
    if isinstance(a, Failure):
        return a
    return b if isinstance(b, Failure) else a <= b


eq_int, lt_int, le_int = eq, lt, le
eq_num, lt_num, le_num = eq, lt, le


def both(a: Truth, b: Truth) -> Truth:
    """Return whether both are true; one that is false decides also if the other one failed."""
    if a is False or b is False:
        return False
    return b if a is True else a


def either(a: Truth, b: Truth) -> Truth:
    """Return whether one is true; one that is true decides also if the other one failed."""
    if a is True or b is True:
        return True
    return b if a is False else a


def opposite(a: Truth) -> Truth:
    """Return whether it is false."""
    return a if isinstance(a, Failure) else not a


def first_failure(*values: float | Failure) -> Failure | None:
    """Return the first failure among values."""
    return next((one for one in values if isinstance(one, Failure)), None)
