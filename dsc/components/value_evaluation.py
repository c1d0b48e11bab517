"""Evaluation of a condition on the newest values of push ports; see `value_conditions`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dsc.components.checks import Check, Series
from knowledge_base.errors import InputError
from knowledge_base.language.evaluation.terms import FOLD, ORDER, same
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Constant,
    Expression,
    Imply,
    Not,
    Or,
    Term,
    Variable,
)
from knowledge_base.language.syntax.text import to_text
from knowledge_base.user_objects import described


class ValueEvaluation:
    """Evaluation of conditions and terms that `ValueVocabulary.check` accepts.

    Args:
        series: the newest values, by names such as `scan.metres`.
        checks: the functions that a condition may use, by name.
        variables: the values of variables.
        is_silent: returns whether nothing has come from a port for a number of seconds.
    """

    def __init__(
        self,
        series: Mapping[str, Series],
        checks: Mapping[str, Check],
        variables: Mapping[str, Any],
        is_silent: Callable[[str, float], bool],
    ) -> None:
        self._series, self._checks, self._values, self._is_silent = series, checks, variables, is_silent

    def is_true(self, e: Expression) -> bool:  # noqa: PLR0911  # a table by form
        """Return whether a condition is true.

        Raises:
            InputError: a part cannot be computed.
        """
        match e:
            case And(parts):
                return all(map(self.is_true, parts))
            case Or(parts):
                return any(map(self.is_true, parts))
            case Not(body):
                return not self.is_true(body)
            case Imply(premise, conclusion):
                return not self.is_true(premise) or self.is_true(conclusion)
            case Comparison(compare, left, right):
                return self._compares(compare, self._value(left), self._value(right), e)
            case Atom("silent", (Constant(port), Constant(seconds))):
                return self._is_silent(str(port), float(seconds))
            case Atom(name, args):
                return bool(self._call_check(name, args, e))
            case _:
                raise AssertionError(f"a quantifier was checked: {to_text(e)}")

    def _compares(self, compare: str, left: Any, right: Any, e: Comparison) -> bool:
        if compare in {"=", "!="}:
            return same(left, right) is (compare == "=")
        for one in (left, right):
            if isinstance(one, bool) or not isinstance(one, int | float):
                raise InputError(f"{to_text(e)} compares numbers, not {one!r}", place=e.place)
        return ORDER[compare](left, right)

    def _value(self, term: Term) -> Any:
        match term:
            case Constant(value) if isinstance(value, str) and value in self._series:
                return self._series[value].newest
            case Constant(value):
                return value
            case Variable(name):
                return self._values[name]
            case Call("list", args) | Arithmetic("geometry", args):
                return [self._value(arg) for arg in args]
            case Call(name, args):
                return self._call_check(name, args, term)
            case Arithmetic(sign, args):
                return _compute(sign, [self._value(arg) for arg in args], term)

    def _call_check(self, name: str, args: tuple[Term, ...], form: Expression | Term) -> Any:
        given = [self._argument(arg) for arg in args]
        try:
            return self._checks[name](*given)
        except InputError as error:
            raise InputError(f"{to_text(form)}: {error.message}", place=form.place) from error
        except TypeError as error:  # a variable has a value of another type
            raise InputError(f"{to_text(form)}: {described(error, named=False)}", place=form.place) from error

    def _argument(self, term: Term) -> Any:
        if isinstance(term, Constant) and isinstance(term.value, str) and term.value in self._series:
            return self._series[term.value]
        return self._value(term)


def _compute(sign: str, values: list[Any], term: Term) -> Any:
    for one in values:
        if isinstance(one, bool) or not isinstance(one, int | float):
            raise InputError(f"{to_text(term)} computes with numbers, not {one!r}", place=term.place)
    first, *rest = values
    if sign == "-" and not rest:
        return -first
    for one in rest:
        if sign == "/" and one == 0:
            raise InputError(f"{to_text(term)} divides by zero", place=term.place)
        first = FOLD[sign](first, one)
    return first
