"""A PDDL domain file as read: declarations and actions in their written form, nothing resolved yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from knowledge_base.errors import ParseError, Place
from knowledge_base.exchange.action_text import ACTION, DURATIVE_ACTION, ActionText, read_actions
from knowledge_base.exchange.beyond import OBJECT_FLUENTS, refuse_forms, refused
from knowledge_base.exchange.files import text_and_source
from knowledge_base.exchange.sections import read_definition, word
from knowledge_base.language.expression import Expression, TypedVariable
from knowledge_base.language.parser import parse_condition
from knowledge_base.language.sexpr import Group, Node, Word
from knowledge_base.language.typed_list import TypedName, parse_names, typed_variables

_SECTIONS = (
    ":requirements",
    ":types",
    ":constants",
    ":predicates",
    ":functions",
    ACTION,
    DURATIVE_ACTION,
    ":derived",
)


@dataclass(frozen=True, slots=True)
class DeclarationText:
    """A predicate or function as declared: `(on ?a ?b - item)`."""

    name: str
    parameters: tuple[TypedVariable, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class AxiomText:
    """One `:derived` section: `head` holds wherever the condition does (PDDL 2.2)."""

    head: DeclarationText
    condition: Expression


@dataclass(frozen=True, slots=True)
class DomainText:
    """All of a domain file, in the order of the file; names are in lower case.

    `notes` says with its place what deserves a look though it changes nothing.
    """

    name: str
    requirements: tuple[str, ...]
    types: tuple[TypedName, ...]
    constants: tuple[TypedName, ...]
    predicates: tuple[DeclarationText, ...]
    functions: tuple[DeclarationText, ...]
    actions: tuple[ActionText, ...]
    axioms: tuple[AxiomText, ...] = ()
    notes: tuple[str, ...] = ()


def read_domain(text_or_path: str | Path, source: str | None = None) -> DomainText:
    """Read a PDDL domain: a `Path` or a file's name, or the text itself.

    Args:
        text_or_path: a file, or text that begins with `(` or a comment.
        source: the name of the text in messages.

    Raises:
        InputError: the file cannot be read.
        ParseError: the form is wrong.
        UnsupportedConstructError: a part of PDDL is used that nothing here can plan with.
        SchemaError: two actions have one name.
    """
    return parse_domain(*text_and_source(text_or_path, source))


def parse_domain(text: str, source: str | None = None) -> DomainText:
    """Read a PDDL domain from its text; `source` names it in messages.

    Raises:
        ParseError: the form is wrong.
        UnsupportedConstructError: a part of PDDL is used that nothing here can plan with.
        SchemaError: two actions have one name.
    """
    definition = read_definition(text, source, "domain", _SECTIONS)
    return DomainText(
        name=definition.name,
        requirements=definition.requirements(),
        types=tuple(parse_names(definition.nodes(":types"))),
        constants=tuple(parse_names(definition.nodes(":constants"))),
        predicates=tuple(_declarations(definition.nodes(":predicates"))),
        functions=tuple(_declarations(definition.nodes(":functions"), result="number")),
        actions=read_actions(definition.sections),
        axioms=tuple(_axiom(group) for keyword, group in definition.sections if keyword == ":derived"),
        notes=tuple(definition.notes()),
    )


def _declarations(nodes: Sequence[Node], result: str | None = None) -> list[DeclarationText]:
    found: list[DeclarationText] = []
    position = 0
    while position < len(nodes):
        node = nodes[position]
        if isinstance(node, Word):
            position = _after_result_type(nodes, position, result)
            continue
        declared = _declaration(node)
        if declared.name != "=":  # declared by old files, though the language has it
            found.append(declared)
        position += 1
    return found


def _declaration(group: Group) -> DeclarationText:
    head = group.head()
    if head is None or head[0] in "?:":
        raise ParseError("a declaration begins with a name: (NAME ?x - TYPE)", place=group.place)
    return DeclarationText(head, typed_variables(group.items[1:]), group.place)


def _after_result_type(nodes: Sequence[Node], position: int, result: str | None) -> int:
    """Skip the `- number` that may follow functions."""
    here = word(nodes[position], "a declaration")
    if result is None or here.text != "-" or position == 0:
        raise ParseError("a declaration is written in parentheses: (NAME ?x - TYPE)", place=here.place)
    if position + 1 == len(nodes):
        raise ParseError("'-' without a type after it", place=here.place)
    kind = word(nodes[position + 1], "a type")
    if kind.folded() != result:
        raise refused(OBJECT_FLUENTS, f"- {kind.text}", kind.place)
    return position + 2


def _axiom(group: Group) -> AxiomText:
    if len(group.items) != 3 or not isinstance(group.items[1], Group):
        raise ParseError("a derived predicate is written (:derived (NAME ?x - TYPE) CONDITION)", place=group.place)
    refuse_forms(group.items[2])
    return AxiomText(_declaration(group.items[1]), parse_condition(group.items[2]))
