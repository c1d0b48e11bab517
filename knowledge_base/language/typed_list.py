"""PDDL's typed lists: `a b - cup  c - (either can bottle)  d`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from knowledge_base.errors import ParseError, Place
from knowledge_base.language.expression import TypedVariable
from knowledge_base.language.sexpr import Group, Node, Word
from knowledge_base.spelling import TRUTH_VALUES, is_number


class TypedName(NamedTuple):
    """A name of a typed list, in lower case and with its `?` if it has one; no types means `object`."""

    name: str
    types: tuple[str, ...]
    place: Place


def parse_typed_list(nodes: Sequence[Node], *, perhaps_none: bool = False) -> list[TypedName]:
    """The names of a typed list with their types, in order.

    Raises:
        ParseError: a `-` without a type after it, or without names before it unless there are `perhaps_none`; a
            group where a name is expected.
    """
    nodes = _unglued(nodes)
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
    """A typed list of things or types, whose names must be told from variables, numbers and keywords.

    There may be none of a type: files that were generated have that.

    Raises:
        ParseError: as `parse_typed_list`, or such a name.
    """
    names = parse_typed_list(nodes, perhaps_none=True)
    for name, _types, place in names:
        if name[:1] in ("?", ":") or name == "" or name in TRUTH_VALUES or is_number(name) or not name.isprintable():
            raise ParseError(f"'{name}' cannot be a name; a name begins with a letter", place=place)
    return names


def parse_variables(node: Node) -> tuple[TypedVariable, ...]:
    """The variables of `(?a ?b - cup)`, as used by quantifiers, parameters and declarations.

    Raises:
        ParseError: no list, a name without `?`, or the same name twice.
    """
    if isinstance(node, Word):
        raise ParseError(f"variables are written in parentheses: ({node.text})", place=node.place)
    return typed_variables(node.items)


def typed_variables(nodes: Sequence[Node], *, distinct: bool = True) -> tuple[TypedVariable, ...]:
    """The variables of a typed list that is not in parentheses of its own, as in `(on ?a ?b - item)`.

    Raises:
        ParseError: a name without `?`, or the same name twice where they have to be `distinct`.
    """
    seen: set[str] = set()
    found: list[TypedVariable] = []
    for name, types, place in parse_typed_list(nodes):
        if not name.startswith("?") or name == "?":
            raise ParseError(f"a variable begins with '?': ?{name.lstrip('?') or 'x'}", place=place)
        if distinct and name in seen:
            raise ParseError(f"the variable '{name}' is declared twice", place=place)
        seen.add(name)
        found.append(TypedVariable(name[1:], types, place=place))
    return tuple(found)


def _unglued(nodes: Sequence[Node]) -> list[Node]:
    """The list with `-cup`, as some files have it, in two words."""
    return [part for node in nodes for part in _parted(node)]


def _parted(node: Node) -> tuple[Node, ...]:
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
