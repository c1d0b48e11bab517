"""Translation of ECMAScript expressions into conditions and terms; the error for an unsupported part has its text.

The supported subset has numbers, strings, truth values, variables, `_event.data.x`, `+ - * /`, comparisons, `&& || !`,
`In()`, and `Math.pow` with a small whole exponent. An expression that relies on a conversion of values is refused; the
scope provides the kinds of values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

from dsc.engine.membership import IN_STATE
from dsc.errors import NotExpressibleError
from dsc.scxml.value_kinds import ANY, BOOLEAN, NO_VALUE, NUMBER, TEXT, UNDEFINED, WHOLE, Scope
from knowledge_base.errors import Place, UnknownNameError
from knowledge_base.language.syntax.expression import (
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

Names = Mapping[str, str] | Scope
"""Names of the plot's variables by the spelling in the document; a mapping has no kinds of values, a `Scope` has."""

_COMPARE = {"===": "=", "==": "=", "!==": "!=", "!=": "!=", "<": "<", "<=": "<=", ">": ">", ">=": ">="}
_FALSE = {BOOLEAN: Constant(False), NUMBER: Constant(0), TEXT: Constant("", quoted=True), UNDEFINED: NO_VALUE}  # noqa: FBT003
"""The value that counts as false, by kind; NaN cannot occur."""
MAX_WHOLE = 2**53
"""Largest whole number that ECMAScript represents exactly."""
MAX_EXPONENT = 8
MAX_NESTING = 50
MAX_OPERATIONS = 100
"""Upper bound of the operations in a term, counted after the expansion of `Math.pow`.

Chains such as `a + b - c` nest terms, and later stages of the reader are recursive.
"""
_WORDS = re.compile(
    r"""\s*(?:
    (?P<number>\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+)
    |(?P<text>'(?:[^'\\\n]|\\.)*'|"(?:[^"\\\n]|\\.)*")
    |(?P<name>[A-Za-z_$][\w$]*(?:\.[A-Za-z_$][\w$]*)*)
    |(?P<sign>\+\+|--|===|!==|==|!=|<=|>=|&&|\|\||[-+*/<>!(),])
    )""",
    re.VERBOSE,
)
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f", "v": "\v"}
_ESCAPE = re.compile(r"\\(u[0-9a-fA-F]{4}|x[0-9a-fA-F]{2}|[^0-9ux])")


class Token(NamedTuple):
    """A token of an expression: its kind (`number`, `text`, `name`, `sign`, `end`) and its text or value."""

    kind: str
    text: str


def condition(text: str, names: Names, place: Place | None = None) -> Expression:
    """Return the condition for the text of a `cond` attribute.

    Args:
        text: the ECMAScript expression.
        names: the names that the expression may use.
        place: place of the expression, for errors.

    Raises:
        NotExpressibleError: a part of the expression has no counterpart in conditions, or relies on a conversion.
        UnknownNameError: the expression uses data that the chart does not declare.
    """
    parser = _Parser(text, names, place)
    return parser.as_condition(parser.whole())


def term(text: str, names: Names, place: Place | None = None) -> Term:
    """Return the term for the text of an `expr` attribute; arguments and errors as for `condition`."""
    parser = _Parser(text, names, place)
    return parser.as_term(parser.whole())


def joined(text: str, names: Names, place: Place | None = None) -> list[Term]:
    """Return the parts of a `log` expression: the terms that `+` joins.

    Operands before the first string are numbers, which `+` adds; they form one part.
    """
    return _Parser(text, names, place).whole_join()


class _Parser:
    def __init__(self, text: str, names: Names, place: Place | None) -> None:
        self._text, self._place = text, place
        self._scope = names if isinstance(names, Scope) else Scope(names)
        self._tokens = tokens(text, place)
        self._at = 0
        self._depth = 0

    def whole(self) -> Expression | Term:
        found = self._or()
        self._end()
        return found

    def whole_join(self) -> list[Term]:
        parts = [self.as_term(self._product())]
        while sign := self._take("+", "-"):
            following = self.as_term(self._product())
            joins = len(parts) > 1 or any(self._scope.kinds_of(one) == {TEXT} for one in (parts[0], following))
            if sign == "+" and joins:
                parts.append(following)
            elif len(parts) > 1:
                raise self._refusal("text cannot be computed with")
            else:
                parts = [self._arithmetic(sign, parts[0], following)]
        self._end()
        return parts

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
            raise self._refusal(f"'{self._tokens[self._at].text}' does not belong there")

    def _refusal(self, why: str) -> NotExpressibleError:
        return NotExpressibleError("expression", f"{why} in '{self._text}'", place=self._place)

    # -- grammar, loosest first ------------------------------------------------------------------------------

    def _or(self) -> Expression | Term:
        return self._parse_chain("||", Or, self._and)

    def _and(self) -> Expression | Term:
        return self._parse_chain("&&", And, self._comparison)

    def _parse_chain(self, sign: str, kind: type[And | Or], part: Callable[[], Expression | Term]) -> Expression | Term:
        parts = [part()]
        while self._take(sign):
            parts.append(part())
        return parts[0] if len(parts) == 1 else kind(tuple(map(self.as_condition, parts)))

    def _comparison(self) -> Expression | Term:
        left = self._sum()
        sign = self._take(*_COMPARE)
        if sign is None:
            return left
        first, second = self.as_term(left), self.as_term(self._sum())
        self._check_comparison(sign, first, second)
        return Comparison(_COMPARE[sign], first, second)

    def _sum(self) -> Expression | Term:
        return self._parse_arithmetic("+-", self._product)

    def _product(self) -> Expression | Term:
        return self._parse_arithmetic("*/", self._unary)

    def _parse_arithmetic(self, signs: str, part: Callable[[], Expression | Term]) -> Expression | Term:
        left = part()
        while sign := self._take(*signs):
            left = self._arithmetic(sign, left, part())
        return left

    def _unary(self) -> Expression | Term:
        self._depth += 1
        if self._depth > MAX_NESTING:
            raise self._refusal("nested too deeply")
        found = self._read_prefix()
        self._depth -= 1
        return found

    def _read_prefix(self) -> Expression | Term:
        if self._take("!"):
            return Not(self.as_condition(self._unary()))
        if self._take("-"):
            inner = self._number(self._unary())
            return Constant(-inner.value) if isinstance(inner, Constant) else Arithmetic("-", (inner,))  # type: ignore[operator]
        if self._take("("):
            inner_part = self._or()
            self._close()
            return inner_part
        return self._simple(self._next())

    def _simple(self, token: Token) -> Expression | Term:
        if token.kind == "number":
            number = float(token.text)
            if not math.isfinite(number):
                raise self._refusal("a number is too large")
            if token.text[:1] == "0" and token.text[1:2].isdigit():
                raise self._refusal(f"'{token.text}' is octal, or an error,")
            return Constant(int(number) if number.is_integer() and number <= MAX_WHOLE else number)
        if token.kind == "text":
            if token.text == NO_VALUE.value:
                raise self._refusal("the text 'undefined' stands for no value")
            return Constant(token.text, quoted=True)
        if token.kind != "name":
            raise self._refusal(f"'{token.text or 'the end'}' does not belong there")
        if token.text in {"true", "false"}:
            return Constant(token.text == "true")
        if token.text == NO_VALUE.value and token.text not in self._scope.names:
            return NO_VALUE
        if self._take("("):
            return self._call(token.text)
        return Variable(self._variable(token.text))

    def _call(self, function: str) -> Expression | Term:
        if function == "In":
            state = self._next()
            self._close()
            if state.kind != "text":
                raise self._refusal("In() takes the name of a state in quotes,")
            return Atom(IN_STATE, (Constant(state.text, quoted=True),))
        if function == "Math.pow":
            base = self._number(self._sum())
            exponent = self.as_term(self._sum()) if self._take(",") else None
            self._close()
            if isinstance(exponent, Constant) and _is_number(exponent) and exponent.value in range(2, MAX_EXPONENT + 1):
                return self._require_short(Arithmetic("*", (base,) * int(exponent.value)))
        raise self._refusal(f"the function {function}() cannot be called")

    def _close(self) -> None:
        if not self._take(")"):
            raise self._refusal("a bracket is not closed")

    def _variable(self, name: str) -> str:
        if name in self._scope.names:
            return self._scope.names[name]
        if name == "_event.data" or name.startswith("_event.data."):
            attribute = name.removeprefix("_event.data").removeprefix(".")
            if "." not in attribute:
                self._scope.check_read(attribute or WHOLE, self._place)
                return f"event.{attribute.lower() or 'data'}"
        if name.startswith("_") or "." in name or name in {"null", "typeof", "function", "new"}:
            raise self._refusal(f"'{name}' has no counterpart")
        raise UnknownNameError(f"there is no data '{name}'", place=self._place, found=name, valid=self._scope.names)

    # -- kinds -------------------------------------------------------------------------------------------

    def _arithmetic(self, sign: str, left: Expression | Term, right: Expression | Term) -> Term:
        sides = (self._number(left), self._number(right))
        if sign == "/" and not (isinstance(sides[1], Constant) and sides[1].value):
            raise self._refusal("only a number other than 0 divides: 1 / 0 is Infinity")
        return self._require_short(Arithmetic(sign, sides))

    def _number(self, part: Expression | Term) -> Term:
        """Return an operand of arithmetic or of an order comparison as a term; refuse an operand of another kind."""
        found = self.as_term(part)
        if isinstance(found, Constant) and not _is_number(found):
            raise self._refusal("text cannot be computed with")
        if not self._scope.want(found, NUMBER):
            raise self._refusal(f"{self._describe(found)} need not be a number, and would be converted,")
        return found

    def _describe(self, found: Term) -> str:
        kinds = " or ".join(sorted(self._scope.kinds_of(found)))
        return f"'{found.name}' ({kinds})" if isinstance(found, Variable) else f"a value ({kinds})"

    def _check_comparison(self, sign: str, left: Term, right: Term) -> None:
        """Refuse comparisons that convert values: `==` between different kinds, and order of values except numbers."""
        if sign not in {"===", "!==", "==", "!="}:
            self._number(left), self._number(right)
            return
        kinds = self._scope.kinds_of(left), self._scope.kinds_of(right)
        for one, known in ((left, kinds[1] - {UNDEFINED}), (right, kinds[0] - {UNDEFINED})):
            if ANY not in known and len(known) == 1 and self._scope.want(one, *known):
                return
        pairs = {(a, b) for a in kinds[0] for b in kinds[1] if a != b or a == ANY}
        if sign in {"==", "!="} and any(UNDEFINED not in pair for pair in pairs) and self._scope.data.kinds is not None:
            found = f"{self._describe(left)} and {self._describe(right)}"
            raise self._refusal(f"'{sign}' may convert {found}; '{sign}=' does not,")

    def _require_short(self, term: Arithmetic) -> Term:
        if _operations(term) > MAX_OPERATIONS:
            raise self._refusal(f"more than {MAX_OPERATIONS} operations")
        return term

    def as_condition(self, part: Expression | Term) -> Expression:
        if isinstance(part, Constant):
            return TRUE if part.value and part != NO_VALUE else Or(())
        return self._truth(part) if isinstance(part, Term) else part

    def _truth(self, value: Term) -> Expression:
        """Return the condition that a value counts as true in ECMAScript: it differs from all false values."""
        kinds = self._scope.kinds_of(value)
        if kinds <= {BOOLEAN, UNDEFINED} or self._scope.want(value, BOOLEAN):
            return Comparison("=", value, Constant(True))  # noqa: FBT003  # `True` is an operand
        if ANY in kinds:
            raise self._refusal(f"{self._describe(value)} would be converted to a truth value")
        parts = [Comparison("!=", value, _FALSE[kind]) for kind in sorted(kinds)]
        return parts[0] if len(parts) == 1 else And(tuple(parts))

    def as_term(self, part: Expression | Term) -> Term:
        if not isinstance(part, Term):
            raise self._refusal("a condition is not a value")
        return part


def _operations(term: Term) -> int:
    return len(term.args) - 1 + sum(map(_operations, term.args)) if isinstance(term, Arithmetic) else 0


def _is_number(constant: Constant) -> bool:
    return isinstance(constant.value, int | float) and not isinstance(constant.value, bool)


def tokens(text: str, place: Place | None) -> list[Token]:
    """Return the tokens of an expression.

    Raises:
        NotExpressibleError: a part is outside the supported subset, e.g. an object in braces.
    """
    found, at, end = [], 0, len(text.rstrip())
    while at < end:
        match = _WORDS.match(text, at)
        if match is None:
            raise NotExpressibleError("expression", f"'{text}' has no counterpart in conditions and terms", place=place)
        kind = match.lastgroup or ""
        word = match[kind]
        found.append(Token(kind, _unquote(word, place) if kind == "text" else word))
        at = match.end()
    return [*found, Token("end", "")]


def _unquote(word: str, place: Place | None) -> str:
    """Return the text of a string literal; two escapes that form a surrogate pair become one character.

    Raises:
        NotExpressibleError: an escape is octal, in braces or incomplete, or is half a surrogate pair.
    """
    inside = word[1:-1]
    if "\\" in _ESCAPE.sub("", inside):
        raise NotExpressibleError("expression", f"an escape in {word} has no counterpart", place=place)
    text = _ESCAPE.sub(lambda escape: _character(escape[1]), inside)
    try:
        return text.encode("utf-16", "surrogatepass").decode("utf-16")
    except UnicodeDecodeError:
        raise NotExpressibleError("expression", f"{word} has half a character", place=place) from None


def _character(escape: str) -> str:
    return chr(int(escape[1:], 16)) if len(escape) > 1 else _ESCAPES.get(escape, escape)
