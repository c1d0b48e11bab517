"""The value of a script on a blackboard, by the rules of BehaviorTree.CPP: results are numbers or texts."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

from dsc.trees.blackboard import EMPTY, Board, Entry
from dsc.trees.script import Assignment, Binary, Comparison, Conditional, Expression, Literal, Name, Script, Unary
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.user_objects import shown

Enums = Mapping[str, int]
"""Constants of enumerations by name."""
EPSILON = 2.0**-23
"""The greatest difference of equal numbers."""
_ARITHMETIC: Mapping[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
}
_COMPARE: Mapping[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
}


def evaluate_script(script: Script, board: Board, enums: Enums) -> object:
    """Execute the statements and return the value of the last one.

    Raises:
        InputError: an entry is missing or has no value yet, or an operator has operands of other types.
    """
    value: object = EMPTY
    for statement in script:
        value = _evaluate(statement, board, enums)
    return value


def is_true(value: object) -> bool:
    """Return whether a number is not 0; raise `InputError` for any other value."""
    if not _is_number(value):
        raise InputError(f"a condition is a number, true or false, not {shown(value)}")
    return bool(value)


def same_text(one: str, other: str, enums: Enums) -> bool:
    """Return whether two texts are equal, also as constants or numbers, as a `Switch` compares them."""
    if one == other:
        return True
    try:
        return abs(_number_of(one, enums) - _number_of(other, enums)) <= EPSILON
    except InputError:
        return False


def text_of_value(value: object) -> str:
    """Return a value as text; a number that is not an integer has six decimals."""
    if isinstance(value, float):
        return f"{value:f}"
    return str(int(value)) if isinstance(value, bool) else str(value)


def _evaluate(part: Expression, board: Board, enums: Enums) -> object:
    if isinstance(part, Literal):
        return part.value
    return _look_up(part.name, board, enums) if isinstance(part, Name) else _compute(part, board, enums)


def _compute(part: Unary | Binary | Comparison | Conditional | Assignment, board: Board, enums: Enums) -> object:
    match part:
        case Unary(sign, operand):
            return _negate(sign, _number(_evaluate(operand, board, enums), sign))
        case Conditional(condition, then, otherwise):
            holds = _number_of(_evaluate(condition, board, enums), enums)
            return _evaluate(then if holds else otherwise, board, enums)
        case Binary(sign, left, right):
            return _combine(sign, _evaluate(left, board, enums), _evaluate(right, board, enums))
        case Comparison():
            return _compare(part, board, enums)
        case Assignment():
            return _assign(part, board, enums)


def _negate(sign: str, value: float) -> float:
    return -value if sign == "-" else float(not value)


def _look_up(name: str, board: Board, enums: Enums) -> object:
    if name in enums:
        return float(enums[name])
    entry = board.entry(name)
    if entry is None:
        valid = [*board.entries, *enums]
        raise UnknownNameError(f"the blackboard has no entry '{name}'", found=name, valid=valid)
    return entry.value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float)


def _number(value: object, sign: str) -> float:
    if not isinstance(value, int | float):
        raise InputError(f"'{sign}' needs a number, not {_describe(value)}")
    return float(value)


def _describe(value: object) -> str:
    return "an entry without a value" if value is EMPTY else shown(value)


def _number_of(value: object, enums: Enums) -> float:
    """Return a number, or the number that a text names."""
    if isinstance(value, int | float):
        return float(value)
    if isinstance(value, str):
        if value in {"true", "false"}:
            return float(value == "true")
        if value in enums:
            return float(enums[value])
        try:
            return float(value)
        except ValueError:
            pass
    raise InputError(f"a number was expected, not {_describe(value)}")


def _combine(sign: str, left: object, right: object) -> object:
    if isinstance(left, str) or isinstance(right, str):
        if (sign == "+" and isinstance(left, str) and isinstance(right, str)) or (
            sign == ".." and EMPTY not in {left, right}
        ):
            return text_of_value(left) + text_of_value(right)
        raise InputError(f"'{sign}' cannot combine {_describe(left)} with {_describe(right)}")
    one, other = _number(left, sign), _number(right, sign)
    if sign == "/":
        if other == 0:
            raise InputError(f"the division of {one:g} by 0 has no value")
        return one / other
    if sign in {"&&", "||"}:
        return float(bool(one) and bool(other) if sign == "&&" else bool(one) or bool(other))
    if sign not in _ARITHMETIC:
        raise InputError(f"'{sign}' joins texts, not two numbers")
    return _ARITHMETIC[sign](one, other)


def _compare(part: Comparison, board: Board, enums: Enums) -> float:
    left = _evaluate(part.operands[0], board, enums)
    for sign, operand in zip(part.operators, part.operands[1:], strict=True):
        right = _evaluate(operand, board, enums)
        if not _holds(sign, left, right, enums):
            return 0.0
        left = right
    return 1.0


def _holds(sign: str, left: object, right: object, enums: Enums) -> bool:
    if isinstance(left, str) and isinstance(right, str):
        same = left == right
        return same if sign == "==" else not same if sign == "!=" else _COMPARE[sign](left, right)
    one, other = _number_of(left, enums), _number_of(right, enums)
    same = abs(one - other) <= EPSILON
    return same if sign == "==" else not same if sign == "!=" else _COMPARE[sign](one, other)


def _assign(part: Assignment, board: Board, enums: Enums) -> object:
    entry = board.entry(part.name)
    if entry is None:
        if part.operator != ":=":
            message = f"the blackboard has no entry '{part.name}', which ':=' would create"
            raise UnknownNameError(message, found=part.name, valid=board.entries)
        entry = board.create(part.name)
    value = _evaluate(part.value, board, enums)
    if value is EMPTY:
        raise InputError(f"'{part.operator}' needs a value, not {_describe(value)}")
    if part.operator in {":=", "="}:
        entry.value = fit_value(part.name, entry, value, enums)
    elif isinstance(value, str) and (part.operator != "+=" or not isinstance(entry.value, str)):
        raise InputError(f"'{part.operator}' cannot change {_describe(entry.value)} by {_describe(value)}")
    else:
        entry.value = fit_value(part.name, entry, _combine(part.operator[0], entry.value, value), enums)
    return entry.value


def fit_value(name: str, entry: Entry, value: object, enums: Enums) -> object:
    """Return a value of the entry's present type: an integer, a number or a text.

    Raises:
        InputError: the value cannot have this type.
    """
    before = 0 if entry.value is EMPTY and entry.integer else entry.value
    if isinstance(before, str) and not isinstance(value, str):
        raise InputError(f"the entry '{name}' is a text and cannot become {shown(value)}")
    if not _is_number(before):
        return value
    number = _number_of(value, enums)
    if isinstance(before, float):
        return number
    if not number.is_integer():
        raise InputError(f"the entry '{name}' is an integer and cannot become {number:g}")
    return int(number)
