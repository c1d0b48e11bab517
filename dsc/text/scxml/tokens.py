"""The words of the ECMAScript expressions that SCXML charts use."""

from __future__ import annotations

import re
from dataclasses import dataclass

from dsc.text.scxml.errors import NotExpressibleError
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
_BY_NUMBER = re.compile(r"(?<!\\)(?:\\\\)*\\[0-9ux]")


@dataclass(frozen=True, slots=True)
class Token:
    """A word: its kind (`number`, `text`, `name`, `sign`, `end`) and what it says."""

    kind: str
    text: str


def tokens(text: str, place: Place | None) -> list[Token]:
    """The words of an expression.

    Raises:
        NotExpressibleError: something in it is no part of the subset, e.g. an object in braces.
    """
    found, at, end = [], 0, len(text.rstrip())
    while at < end:
        match = _WORDS.match(text, at)
        if match is None:
            raise NotExpressibleError("expression", f"'{text}' cannot be said in conditions and terms", place=place)
        kind = match.lastgroup or ""
        word = match[kind]
        if kind == "text" and _BY_NUMBER.search(word):
            raise NotExpressibleError("expression", f"an escape by number in {word} has no counterpart", place=place)
        found.append(Token(kind, _unquoted(word) if kind == "text" else word))
        at = match.end()
    return [*found, Token("end", "")]


def _unquoted(word: str) -> str:
    return re.sub(r"\\(.)", lambda escaped: _ESCAPES.get(escaped[1], escaped[1]), word[1:-1])
