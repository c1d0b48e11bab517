r"""Reader of text as nested groups of words and of typed lists: the outer form of all PDDL text.

A word is a sequence of characters other than blanks, parentheses, quotes and semicolons. A `?` begins a new word, since
some files contain `(on?x ?y)`. `;` starts a comment; `"..."` is text with the escapes `\"`, `\\`, `\n`, `\r`.

The reader is iterative, but all functions on its result recurse, so that `MAX_DEPTH` limits the nesting. The
compilation of nested quantifiers needs the most: seven Python frames for each. If the caller uses 150 of Python's 1,000
frames, the maximum is a nesting of about 120.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from knowledge_base.errors import ParseError, Place
from knowledge_base.language.syntax.expression import TypedVariable
from knowledge_base.origin import Origin
from knowledge_base.spelling import TRUTH_VALUES, is_number, text_inside

MAX_DEPTH = 100

_TOKEN = re.compile(
    r"""(?P<skip>\s+|;[^\n]*)|(?P<open>\()|(?P<close>\))|(?P<text>"(?:[^"\\]|\\.)*")|(?P<word>[^\s()";][^\s()";?]*)""",
    re.DOTALL,
)
_HALF = re.compile("[\udc80-\udcff]")  # bytes of a file that are not UTF-8
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")


@dataclass(frozen=True, slots=True)
class Word:
    """One word as written, or the content of a quoted text."""

    text: str
    place: Place
    quoted: bool = False

    def folded(self) -> str:
        """Return the word in lower case, as PDDL compares names; quoted text stays unchanged."""
        return self.text if self.quoted else self.text.lower()


@dataclass(frozen=True, slots=True)
class Group:
    """The content between two parentheses; `place` is the place of the opening parenthesis."""

    items: tuple[Node, ...]
    place: Place

    def head(self) -> str | None:
        """Return the first word in lower case, which is the kind of the group.

        Return `None` if the group does not begin with a word.
        """
        first = self.items[0] if self.items else None
        return first.folded() if isinstance(first, Word) and not first.quoted else None


Node = Word | Group


def read(text: str, source: str | Origin | None = None) -> list[Node]:
    """Return the groups and words at the top level of `text`, in order.

    Args:
        text: the whole text.
        source: name of the file that contains the text, or the origin of the text in a file, for messages.

    Raises:
        ParseError: a parenthesis or quote has no partner, the nesting exceeds `MAX_DEPTH`, a byte is not UTF-8, or a
            word contains a control character.
    """
    top: list[Node] = []
    origin = source if isinstance(source, Origin) else Origin(source)
    stack = [(origin.place(1, 1), top)]
    for kind, word, place in _tokens(text, origin):
        if kind == "open":
            if len(stack) > MAX_DEPTH:
                raise ParseError(f"parentheses are nested more than {MAX_DEPTH} deep", place=place)
            stack.append((place, []))
        elif kind == "close":
            if len(stack) == 1:
                raise ParseError("')' without a '(' before it", place=place)
            begun, items = stack.pop()
            stack[-1][1].append(Group(tuple(items), begun))
        else:
            stack[-1][1].append(_word(kind, word, place))
    if len(stack) > 1:
        raise _partner_error(stack)
    return top


def _partner_error(stack: list[tuple[Place, list[Node]]]) -> ParseError:
    """Return the error about a '(' without its partner: one inside which a section such as `(:action` begins."""
    innermost = stack[-1][0]
    while len(stack) > 1:
        begun, items = stack.pop()
        stack[-1][1].append(Group(tuple(items), begun))
    for definition in stack[0][1]:
        for section in definition.items if isinstance(definition, Group) else ():
            found = _section_inside(section)
            if found is not None:
                outer, inner = found
                inside = f"'{inner.head()}' begins inside it, in line {inner.place.line}"
                return ParseError(f"'(' of '{outer.head()}' is never closed: {inside}", place=outer.place)
    return ParseError("'(' is never closed", place=innermost)


def _section_inside(node: Node) -> tuple[Group, Group] | None:
    """Return the first group that directly contains a section, and the section."""
    if not isinstance(node, Group):
        return None
    for child in node.items:
        if isinstance(child, Group) and (child.head() or "").startswith(":"):
            return node, child
        found = _section_inside(child)
        if found is not None:
            return found
    return None


def _tokens(text: str, origin: Origin) -> Iterator[tuple[str, str, Place]]:
    at, line, line_start, source = 0, origin.line, 1 - origin.column, origin.source
    while at < len(text):
        place = Place(source, line, max(at - line_start + 1, 1))  # a program may add indentation to its text
        found = _TOKEN.match(text, at)
        if found is None:  # every other character starts a token
            raise ParseError("'\"' is never closed", place=place)
        token, at = found.group(), found.end()
        if found.lastgroup is not None and found.lastgroup != "skip":
            yield found.lastgroup, token, place
        if "\n" in token:
            line += token.count("\n")
            line_start = found.start() + token.rindex("\n") + 1 - origin.indent


def _word(kind: str, token: str, place: Place) -> Word:
    if _HALF.search(token):
        raise ParseError("this is not UTF-8 text", place=place)
    if kind == "word" and _CONTROL.search(token):  # it would be invisible in messages
        raise ParseError(f"'{token}' has a control character", place=place)
    if kind == "word":
        return Word(token, place)
    return Word(text_inside(token), place, quoted=True)


class TypedName(NamedTuple):
    """One name of a typed list, in lower case, with its `?` if it has one; empty `types` stand for `object`."""

    name: str
    types: tuple[str, ...]
    place: Place


def parse_typed_list(nodes: Sequence[Node], *, perhaps_none: bool = False) -> list[TypedName]:
    """Return the names of a typed list with their types, in order.

    Raises:
        ParseError: a `-` has no type after it, or no names before it unless `perhaps_none`; or a group is found
            where a name is expected.
    """
    nodes = _unglue(nodes)
    found: list[TypedName] = []
    untyped: list[Word] = []
    position = 0
    while position < len(nodes):
        node = nodes[position]
        if isinstance(node, Group):
            raise ParseError("a name is expected here, not '('", place=node.place)
        if node.text != "-":
            untyped.append(node)
            position += 1
            continue
        if not untyped and not perhaps_none:
            raise ParseError("'-' without a name before it", place=node.place)
        if position + 1 == len(nodes):
            raise ParseError("'-' without a type after it", place=node.place)
        types = _types(nodes[position + 1])
        found += [TypedName(w.folded(), types, w.place) for w in untyped]
        untyped.clear()
        position += 2
    return found + [TypedName(w.folded(), (), w.place) for w in untyped]


def parse_names(nodes: Sequence[Node]) -> list[TypedName]:
    """Return the names of a typed list of objects or types.

    A type without names is accepted, since generated files contain such types.

    Raises:
        ParseError: as for `parse_typed_list`; or a name has the form of a variable, number or keyword.
    """
    names = parse_typed_list(nodes, perhaps_none=True)
    for name, _types, place in names:
        if name[:1] in ("?", ":") or name == "" or name in TRUTH_VALUES or is_number(name) or not name.isprintable():
            raise ParseError(f"'{name}' cannot be a name; a name begins with a letter", place=place)
    return names


def parse_variables(node: Node) -> tuple[TypedVariable, ...]:
    """Return the variables of `(?a ?b - cup)`, the form in quantifiers, parameters and declarations.

    Raises:
        ParseError: `node` is not a list, a name has no `?`, or a name occurs twice.
    """
    if isinstance(node, Word):
        raise ParseError(f"variables are written in parentheses: ({node.text})", place=node.place)
    return typed_variables(node.items)


def typed_variables(nodes: Sequence[Node], *, distinct: bool = True) -> tuple[TypedVariable, ...]:
    """Return the variables of a typed list without parentheses, as in `(on ?a ?b - item)`.

    Raises:
        ParseError: a name has no `?`; or a name occurs twice, if the names must be `distinct`.
    """
    seen: set[str] = set()
    found: list[TypedVariable] = []
    for name, types, place in parse_typed_list(nodes):
        if not name.startswith("?") or name == "?":
            hint = "" if name == "?" else f"; a type follows a dash: - {name}"
            raise ParseError(f"a variable begins with '?': ?{name.lstrip('?') or 'x'}{hint}", place=place)
        if distinct and name in seen:
            raise ParseError(f"the variable '{name}' is declared twice", place=place)
        seen.add(name)
        found.append(TypedVariable(name[1:], types, place=place))
    return tuple(found)


def _unglue(nodes: Sequence[Node]) -> list[Node]:
    """Return the list with a word such as `-cup`, which some files contain, split into `-` and `cup`."""
    return [part for node in nodes for part in _split_dash(node)]


def _split_dash(node: Node) -> tuple[Node, ...]:
    if isinstance(node, Group) or node.quoted or not node.text.startswith("-") or is_number(node.text):
        return (node,)
    after = Place(node.place.source, node.place.line, (node.place.column or 0) + 1)
    return (Word("-", node.place), *([Word(node.text[1:], after)] if node.text != "-" else []))


def _types(node: Node) -> tuple[str, ...]:
    if isinstance(node, Word):
        return (node.folded(),)
    if node.head() != "either" or len(node.items) == 1:
        raise ParseError("after '-' comes a type or (either TYPE ...)", place=node.place)
    return tuple(_type_name(n) for n in node.items[1:])


def _type_name(node: Node) -> str:
    if isinstance(node, Group):
        raise ParseError("a type's name is expected here, not '('", place=node.place)
    return node.folded()
