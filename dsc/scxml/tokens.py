"""Tokens of the ECMAScript expressions in SCXML charts."""

from __future__ import annotations

import re
from dataclasses import dataclass

from dsc.errors import NotExpressibleError
from knowledge_base.errors import Place

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


@dataclass(frozen=True, slots=True)
class Token:
    """A token: its kind (`number`, `text`, `name`, `sign`, `end`) and its text or value."""

    kind: str
    text: str


def tokens(text: str, place: Place | None) -> list[Token]:
    """Return the tokens of an expression.

    Raises:
        NotExpressibleError: a part is outside the subset, e.g. an object in braces.
    """
    found, at, end = [], 0, len(text.rstrip())
    while at < end:
        match = _WORDS.match(text, at)
        if match is None:
            raise NotExpressibleError("expression", f"'{text}' has no counterpart in conditions and terms", place=place)
        kind = match.lastgroup or ""
        word = match[kind]
        found.append(Token(kind, _unquoted(word, place) if kind == "text" else word))
        at = match.end()
    return [*found, Token("end", "")]


def _unquoted(word: str, place: Place | None) -> str:
    """Return the text of a string literal; two escapes that form a surrogate pair become one character.

    Raises:
        NotExpressibleError: an escape is octal, in braces or cut short, or there is half a surrogate pair.
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
