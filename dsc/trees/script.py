"""Scripts of BehaviorTree.CPP: their syntax, as frozen values.

The common part is read: assignments, arithmetic, comparison, logic, the conditional `?:`, and texts in single quotes.
Bit operations are refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from knowledge_base.errors import ParseError, printable

MAX_INTEGER = 2**63 - 1
"""The largest integer in a script, as in BehaviorTree.CPP."""
MAX_DIGITS = 30
"""Number of digits, zeros included, of the longest integer."""
MAX_NESTED = 50
"""Upper bound of nested expressions."""


@dataclass(frozen=True, slots=True)
class Literal:
    """A number or a text."""

    value: float | int | str


@dataclass(frozen=True, slots=True)
class Name:
    """An entry of the blackboard, or a constant of an enumeration."""

    name: str


@dataclass(frozen=True, slots=True)
class Unary:
    """`-` or `!` before an expression."""

    operator: str
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary:
    """Arithmetic, logic, or `..`, which joins texts."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Comparison:
    """A chain of comparisons, e.g. `0 < x <= 5`, which is true if each one is."""

    operators: tuple[str, ...]
    operands: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Conditional:
    """`condition ? then : otherwise`."""

    condition: Expression
    then: Expression
    otherwise: Expression


@dataclass(frozen=True, slots=True)
class Assignment:
    """An assignment to an entry; `:=` creates a missing entry."""

    name: str
    operator: str
    value: Expression


Expression = Literal | Name | Unary | Binary | Comparison | Conditional | Assignment
Script = tuple[Expression, ...]
"""The statements of a script; the last one has the value of the script."""

_TOKEN = re.compile(
    r"(?P<blank>\s+)|(?P<real>\d+(?:\.\d+(?:[eE][+-]?\d+)?|[eE][+-]?\d+))|(?P<hex>0[xX][0-9a-fA-F]+)|(?P<integer>\d+)"
    r"|'(?P<text>[^']*)'|(?P<name>[A-Za-z_@][A-Za-z0-9_]*)"
    r"|(?P<operator>:=|\+=|-=|\*=|/=|==|!=|<=|>=|&&|\|\||\.\.|[-+*/!<>=?:();&|^~])"
)
_ASSIGN = frozenset({":=", "=", "+=", "-=", "*=", "/="})
_COMPARE = frozenset({"==", "!=", "<", ">", "<=", ">="})
_BITS = frozenset("&|^~")
_BINDING: Mapping[str, int] = {
    **dict.fromkeys(_ASSIGN, 2),
    "?": 4,
    "||": 6,
    "&&": 8,
    **dict.fromkeys(_COMPARE, 10),
    "+": 16,
    "-": 16,
    "..": 16,
    "*": 18,
    "/": 18,
}
"""The strength with which an operator binds its operands, as in BehaviorTree.CPP."""
_COMPARISON, _CONDITIONAL, _PREFIX = 10, 4, 20


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    at: int


def parse_script(text: str) -> Script:
    """Return the statements of a script.

    Raises:
        ParseError: the text is not a script, or has an operator on bits; the message has the position in the text.
    """
    parser = _Parser(text)
    statements: list[Expression] = []
    while parser.token.kind != "end":
        statements.append(parser.expression(0))
        if parser.token.kind != "end" and parser.token.text != ";":
            raise parser.mistake(f"';' or the end was expected; found '{parser.token.text}'")
        while parser.token.text == ";" and parser.token.kind == "operator":
            parser.advance()
    if not statements:
        raise ParseError("the script is empty")
    return tuple(statements)


class _Parser:
    def __init__(self, text: str) -> None:
        self._text = text
        self._nested = 0
        self._tokens = self._scan(text)
        self._next = 0

    @property
    def token(self) -> _Token:
        return self._tokens[self._next]

    def advance(self) -> _Token:
        token = self.token
        self._next += token.kind != "end"
        return token

    def mistake(self, message: str) -> ParseError:
        return ParseError(f"{message}, at position {self.token.at + 1} of the script '{printable(self._text)}'")

    def _scan(self, text: str) -> list[_Token]:
        tokens: list[_Token] = []
        at = 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None or (match.lastgroup in {"real", "integer", "hex"} and text[match.end() :][:1].isalnum()):
                raise ParseError(f"no token begins at position {at + 1} of the script '{printable(text)}'")
            if match.lastgroup and match.lastgroup != "blank":
                tokens.append(_Token(match.lastgroup, match[match.lastgroup], at))
            at = match.end()
        return [*tokens, _Token("end", "", at)]

    def expression(self, least: int) -> Expression:
        self._nested += 1
        if self._nested > MAX_NESTED:
            raise self.mistake(f"the expression is nested deeper than {MAX_NESTED} levels")
        left = self._prefix()
        while self.token.kind == "operator":
            operator = self.token.text
            binding = _BINDING.get(operator, -1)
            if operator in _BITS:
                raise self.mistake(f"the operator '{operator}' on bits is not supported")
            if binding < 0 or binding < least:
                break
            left = self._infix(left, operator, binding)
            if binding <= _CONDITIONAL:
                break  # assignment and conditional do not associate
        self._nested -= 1
        return left

    def _infix(self, left: Expression, operator: str, binding: int) -> Expression:
        if operator in _COMPARE:
            return self._comparison(left)
        self.advance()
        if operator in _ASSIGN:
            if not isinstance(left, Name):
                raise self.mistake(f"left of '{operator}' a name was expected")
            return Assignment(left.name, operator, self.expression(0))
        if operator == "?":
            then = self.expression(0)
            self._expect(":")
            return Conditional(left, then, self.expression(_CONDITIONAL))
        return Binary(operator, left, self.expression(binding + 1))

    def _comparison(self, first: Expression) -> Expression:
        operators, operands = [], [first]
        while self.token.kind == "operator" and self.token.text in _COMPARE:
            operators.append(self.advance().text)
            operands.append(self.expression(_COMPARISON + 1))
        return Comparison(tuple(operators), tuple(operands))

    def _prefix(self) -> Expression:
        token = self.token
        if token.kind == "operator":
            return self._parenthesis_or_unary(token)
        if token.kind == "end":
            raise self.mistake("an operand was expected; found the end")
        self.advance()
        if token.kind == "name":
            return Literal(float(token.text == "true")) if token.text in {"true", "false"} else Name(token.text)
        if token.kind in {"integer", "hex"}:
            return Literal(self._integer(token))
        return Literal(float(token.text) if token.kind == "real" else token.text)

    def _integer(self, token: _Token) -> int:
        value = int(token.text, 16 if token.kind == "hex" else 10) if len(token.text) <= MAX_DIGITS else None
        if value is None or value > MAX_INTEGER:
            raise self.mistake(f"the integer '{token.text[:20]}' has more than 64 bits")
        return value

    def _parenthesis_or_unary(self, token: _Token) -> Expression:
        if token.text in {"-", "!"}:
            self.advance()
            return Unary(token.text, self.expression(_PREFIX))
        if token.text != "(":
            raise self.mistake(f"an operand was expected; found '{token.text}'")
        self.advance()
        inner = self.expression(0)
        self._expect(")")
        return inner

    def _expect(self, text: str) -> None:
        if self.token.kind != "operator" or self.token.text != text:
            raise self.mistake(f"'{text}' was expected; found '{self.token.text or 'the end'}'")
        self.advance()
