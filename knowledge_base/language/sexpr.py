r"""Text to nested groups of words: the outer form of all PDDL text.

A word is a run of characters other than blanks, parentheses, quotes and semicolons, and `?` begins a new one
(`(on?x ?y)` is found in files); `;` starts a comment; `"..."` is text with the escapes `\"`, `\\`, `\n`, `\r`.
Reading is iterative; nesting is limited to `MAX_DEPTH` because everything that follows recurses, and nobody writes
conditions that deep. Compiling nested quantifiers takes most, seven Python frames for each, so that with a caller
that has used 150 of the 1,000 frames Python allows, about 120 would be the end.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from knowledge_base.errors import ParseError, Place

MAX_DEPTH = 100

_TOKEN = re.compile(
    r"""(?P<skip>\s+|;[^\n]*)|(?P<open>\()|(?P<close>\))|(?P<text>"(?:[^"\\]|\\.)*")|(?P<word>[^\s()";][^\s()";?]*)""",
    re.DOTALL,
)
_HALF = re.compile("[\udc80-\udcff]")  # what a file's other bytes are read as
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ENDS = {"n": "\n", "r": "\r"}  # of lines: as they are, a file's reader could make one of the other


@dataclass(frozen=True, slots=True)
class Word:
    """One word as written, or the content of a quoted text."""

    text: str
    place: Place
    quoted: bool = False

    def folded(self) -> str:
        """The word in lower case, as PDDL compares names; quoted text as it is."""
        return self.text if self.quoted else self.text.lower()


@dataclass(frozen=True, slots=True)
class Group:
    """What stands between two parentheses; `place` is the opening one."""

    items: tuple[Node, ...]
    place: Place

    def head(self) -> str | None:
        """The first word in lower case, which says what kind of group it is; `None` if there is none."""
        first = self.items[0] if self.items else None
        return first.folded() if isinstance(first, Word) and not first.quoted else None


Node = Word | Group


@dataclass(slots=True)
class _Open:
    place: Place
    items: list[Node] = field(default_factory=list)


def read(text: str, source: str | None = None) -> list[Node]:
    """The groups and words at the top of `text`, in order.

    Args:
        text: the whole text.
        source: the name of the file it comes from, for messages.

    Raises:
        ParseError: a parenthesis or quote without its partner, nesting beyond `MAX_DEPTH`, half a character, or a
            control character in a word.
    """
    stack = [_Open(Place(source, 1, 1))]
    for kind, word, place in _tokens(text, source):
        if kind == "open":
            if len(stack) > MAX_DEPTH:
                raise ParseError(f"parentheses are nested more than {MAX_DEPTH} deep", place=place)
            stack.append(_Open(place))
        elif kind == "close":
            if len(stack) == 1:
                raise ParseError("')' without a '(' before it", place=place)
            done = stack.pop()
            stack[-1].items.append(Group(tuple(done.items), done.place))
        else:
            stack[-1].items.append(_word(kind, word, place))
    if len(stack) > 1:
        raise ParseError("'(' is never closed", place=stack[-1].place)
    return stack[0].items


def _tokens(text: str, source: str | None) -> Iterator[tuple[str, str, Place]]:
    at, line, line_start = 0, 1, 0
    while at < len(text):
        place = Place(source, line, at - line_start + 1)
        found = _TOKEN.match(text, at)
        if found is None:  # every other character starts a token
            raise ParseError("'\"' is never closed", place=place)
        token, at = found.group(), found.end()
        if found.lastgroup is not None and found.lastgroup != "skip":
            yield found.lastgroup, token, place
        if "\n" in token:
            line += token.count("\n")
            line_start = found.start() + token.rindex("\n") + 1


def _word(kind: str, token: str, place: Place) -> Word:
    if _HALF.search(token):
        raise ParseError("this is not UTF-8 text", place=place)
    if kind == "word" and _CONTROL.search(token):  # it would be invisible in every message
        raise ParseError(f"'{token}' has a control character", place=place)
    if kind == "word":
        return Word(token, place)
    plain = _ESCAPE.sub(lambda m: _ENDS.get(m[1], m[1]), token[1:-1])
    return Word(plain, place, quoted=True)
