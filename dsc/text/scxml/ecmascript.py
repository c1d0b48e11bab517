"""The ECMAScript expressions that the one language can say, translated into it; everything else is refused by name.

Numbers, strings, truth values, variables, `_event.data.x`, `+ - * /`, `Math.pow` with a small whole exponent,
comparisons, `&& || !` and `In()`. Comparisons never convert: `==` is read as `===`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from dsc.engine.membership import IN_STATE
from dsc.text.scxml.errors import NotExpressibleError
from dsc.text.scxml.tokens import Token, tokens
from knowledge_base.errors import Place, UnknownNameError
from knowledge_base.language.expression import (
    TRUE,
    And,
    Arithmetic,
    Atom,
    Comparison,
    Constant,
    Expression,
    Not,
    Or,
    Term,
    Variable,
)

_COMPARE = {"===": "=", "==": "=", "!==": "!=", "!=": "!=", "<": "<", "<=": "<=", ">": ">", ">=": ">="}
MAX_EXPONENT = 8
MAX_NESTING = 50
MAX_OPERATIONS = 100
"""Of a term, counted after `Math.pow` is written out: `a + b - c` nests, and what follows recurses."""


def condition(text: str, names: Mapping[str, str], place: Place | None = None) -> Expression:
    """A `cond` as a condition.

    Args:
        text: the expression.
        names: the chart's data by their own spelling -> the name of the variable.
        place: for errors.

    Raises:
        NotExpressibleError: it uses something that conditions cannot say.
        UnknownNameError: it uses data that the chart does not declare.
    """
    return _Parser(text, names, place).whole_condition()


def term(text: str, names: Mapping[str, str], place: Place | None = None) -> Term:
    """An `expr` as a term; see `condition`."""
    return _Parser(text, names, place).whole_term()


def joined(text: str, names: Mapping[str, str], place: Place | None = None) -> list[Term]:
    """What a `log` shows: the terms that `+` joins if one of them is a string, else the one term."""
    return _Parser(text, names, place).whole_join()


class _Parser:
    def __init__(self, text: str, names: Mapping[str, str], place: Place | None) -> None:
        self._text, self._names, self._place = text, names, place
        self._tokens = tokens(text, place)
        self._at = 0
        self._depth = 0

    def whole_condition(self) -> Expression:
        found = self._condition(self._or())
        self._end()
        return found

    def whole_term(self) -> Term:
        found = self._as_term(self._or())
        self._end()
        return found

    def whole_join(self) -> list[Term]:
        if not any(token.kind == "text" for token in self._tokens):
            return [self.whole_term()]
        parts = [self._product()]
        while self._take("+"):
            parts.append(self._product())
        self._end()
        return [self._as_term(part) for part in parts]

    # -- words -------------------------------------------------------------------------------------------

    def _next(self) -> Token:
        token = self._tokens[self._at]
        self._at += token.kind != "end"
        return token

    def _take(self, *signs: str) -> str | None:
        token = self._tokens[self._at]
        if token.kind == "sign" and token.text in signs:
            self._at += 1
            return token.text
        return None

    def _end(self) -> None:
        if self._tokens[self._at].kind != "end":
            raise self._refused(f"'{self._tokens[self._at].text}' does not belong there")

    def _refused(self, why: str) -> NotExpressibleError:
        return NotExpressibleError("expression", f"{why} in '{self._text}'", place=self._place)

    # -- grammar, loosest first ------------------------------------------------------------------------------

    def _or(self) -> Expression | Term:
        parts = [self._and()]
        while self._take("||"):
            parts.append(self._and())
        return parts[0] if len(parts) == 1 else Or(tuple(map(self._condition, parts)))

    def _and(self) -> Expression | Term:
        parts = [self._comparison()]
        while self._take("&&"):
            parts.append(self._comparison())
        return parts[0] if len(parts) == 1 else And(tuple(map(self._condition, parts)))

    def _comparison(self) -> Expression | Term:
        left = self._sum()
        sign = self._take(*_COMPARE)
        if sign is None:
            return left
        return Comparison(_COMPARE[sign], self._as_term(left), self._as_term(self._sum()))

    def _sum(self) -> Expression | Term:
        left = self._product()
        while sign := self._take("+", "-"):
            left = self._arithmetic(sign, left, self._product())
        return left

    def _product(self) -> Expression | Term:
        left = self._unary()
        while sign := self._take("*", "/"):
            left = self._arithmetic(sign, left, self._unary())
        return left

    def _unary(self) -> Expression | Term:
        self._depth += 1
        if self._depth > MAX_NESTING:
            raise self._refused("nested too deeply")
        found = self._prefixed()
        self._depth -= 1
        return found

    def _prefixed(self) -> Expression | Term:
        if self._take("!"):
            return Not(self._condition(self._unary()))
        if self._take("-"):
            inner = self._as_term(self._unary())
            number = inner.value if isinstance(inner, Constant) else None
            return Constant(-number) if isinstance(number, int | float) else Arithmetic("-", (inner,))
        if self._take("("):
            inner_part = self._or()
            self._close()
            return inner_part
        return self._simple(self._next())

    def _simple(self, token: Token) -> Expression | Term:
        if token.kind == "number":
            number = float(token.text)
            if not math.isfinite(number):
                raise self._refused("a number is too large")
            return Constant(int(number) if number.is_integer() else number)
        if token.kind == "text":
            return Constant(token.text, quoted=True)
        if token.kind != "name":
            raise self._refused(f"'{token.text or 'the end'}' does not belong there")
        if token.text in {"true", "false"}:
            return Constant(token.text == "true")
        if self._take("("):
            return self._call(token.text)
        return Variable(self._variable(token.text))

    def _call(self, function: str) -> Expression | Term:
        if function == "In":
            state = self._next()
            self._close()
            if state.kind != "text":
                raise self._refused("In() takes the name of a state in quotes,")
            return Atom(IN_STATE, (Constant(state.text, quoted=True),))
        if function == "Math.pow":
            base = self._as_term(self._sum())
            exponent = self._as_term(self._sum()) if self._take(",") else None
            self._close()
            if isinstance(exponent, Constant) and exponent.value in range(2, MAX_EXPONENT + 1):
                return self._bounded(Arithmetic("*", (base,) * int(exponent.value)))
        raise self._refused(f"the function {function}() cannot be called")

    def _close(self) -> None:
        if not self._take(")"):
            raise self._refused("a bracket is not closed")

    def _variable(self, name: str) -> str:
        if name in self._names:
            return self._names[name]
        if name == "_event.data" or name.startswith("_event.data."):
            attribute = name.removeprefix("_event.").removeprefix("data.")
            if "." not in attribute:
                return f"event.{attribute.lower()}"
        if name.startswith("_") or "." in name or name in {"null", "undefined", "typeof", "function", "new"}:
            raise self._refused(f"'{name}' has no counterpart")
        raise UnknownNameError(f"there is no data '{name}'", place=self._place, found=name, valid=self._names)

    # -- kinds -------------------------------------------------------------------------------------------

    def _arithmetic(self, sign: str, left: Expression | Term, right: Expression | Term) -> Term:
        sides = (self._as_term(left), self._as_term(right))
        if any(isinstance(side, Constant) and not _is_number(side) for side in sides):
            raise self._refused("text cannot be computed with")
        return self._bounded(Arithmetic(sign, sides))

    def _bounded(self, term: Arithmetic) -> Term:
        if _operations(term) > MAX_OPERATIONS:
            raise self._refused(f"more than {MAX_OPERATIONS} operations")
        return term

    def _condition(self, part: Expression | Term) -> Expression:
        if isinstance(part, Constant) and isinstance(part.value, bool):
            return TRUE if part.value else Or(())
        if isinstance(part, Variable):
            return Comparison("=", part, Constant(True))  # noqa: FBT003  # data is not converted to a truth value
        if isinstance(part, Term):
            raise self._refused("a value is no condition")
        return part

    def _as_term(self, part: Expression | Term) -> Term:
        if not isinstance(part, Term):
            raise self._refused("a condition is no value")
        return part


def _operations(term: Term) -> int:
    return len(term.args) - 1 + sum(map(_operations, term.args)) if isinstance(term, Arithmetic) else 0


def _is_number(constant: Constant) -> bool:
    return isinstance(constant.value, int | float) and not isinstance(constant.value, bool)
