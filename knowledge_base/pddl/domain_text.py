"""A PDDL domain file as read: declarations and actions as written; names are not resolved yet."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from knowledge_base.errors import ParseError, Place, nearest
from knowledge_base.facts import UNSET
from knowledge_base.language.syntax.expression import Expression, TypedVariable
from knowledge_base.language.syntax.sexpr import Group, Node, TypedName, Word, parse_names, read, typed_variables
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.pddl.action_text import ACTION, DURATIVE_ACTION, ActionText, read_actions
from knowledge_base.pddl.definition import OBJECT_FLUENTS, read_definition, refuse_forms, refused, word
from knowledge_base.pddl.files import text_and_source

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

MOST_IMPLIED = 50
"""Maximum number of undeclared parents that count as types; each is compared with every declared type."""


@dataclass(frozen=True, slots=True)
class DeclarationText:
    """A predicate or function as declared: `(on ?a ?b - item)`.

    Attributes:
        result: the type of a function's value.
        domain: the name of the domain, or of the fragment of a domain, that contains the declaration.
    """

    name: str
    parameters: tuple[TypedVariable, ...]
    place: Place | None = field(compare=False)
    result: str | None = None
    domain: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class AxiomText:
    """One `:derived` section: `head` is true if the condition is true (PDDL 2.2)."""

    head: DeclarationText
    condition: Expression


@dataclass(frozen=True, slots=True)
class DomainText:
    """The content of a domain file, in the order of the file; names are in lower case.

    `notes` are remarks without influence on the result, each with its place; `source` is the name of the file for
    messages.
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
    source: str | None = field(default=None, compare=False)

    def implied_types(self) -> tuple[TypedName, ...]:
        """Return the undeclared types that occur only as parents of other types.

        A name close to a declared type is a typing error and is omitted. The result is empty if more than
        `MOST_IMPLIED` parents are undeclared.
        """
        declared = {"object", *(name for name, _, _ in self.types)}
        used: dict[str, Place] = {}
        for parent, place in ((p, place) for _, parents, place in self.types for p in parents):
            if parent not in declared:
                used.setdefault(parent, place)
        if len(used) > MOST_IMPLIED:
            return ()
        return tuple(TypedName(name, (), place) for name, place in used.items() if not _misspelt(name, declared))

    def remarks(self) -> Iterator[str]:
        """Yield the notes of the file, and remarks about its declarations as a whole."""
        yield from self.notes
        for name, _, place in self.implied_types():
            yield f"{place}: the type '{name}' is not declared and taken to be one of its own"
        types = {name: place for name, _, place in self.types}
        for predicate in self.predicates:
            if predicate.name in types and len(predicate.parameters) == 1:
                yield (
                    f"{predicate.place}: the predicate '{predicate.name}' has the name of a type"
                    f" (at {types[predicate.name]}); ({predicate.name} ?x) asks for the predicate"
                )


def read_domain(text_or_path: str | Path, source: str | None = None) -> DomainText:
    """Read a PDDL domain from a file (a `Path` or a file name), or from its text.

    Args:
        text_or_path: a file, or text that begins with `(` or a comment.
        source: name of the text in messages.

    Raises:
        InputError: the file cannot be read.
        ParseError: the form is wrong.
        UnsupportedConstructError: the file uses a construct that no planner here supports.
        SchemaError: two different actions have one name.
    """
    return parse_domain(*text_and_source(text_or_path, source))


def parse_domain(text: str, source: str | None = None) -> DomainText:
    """Read a PDDL domain from its text; `source` is the name of the text in messages.

    Raises:
        ParseError: the form is wrong.
        UnsupportedConstructError: the text uses a construct that no planner here supports.
        SchemaError: two different actions have one name.
    """
    definition = read_definition(text, source, "domain", _SECTIONS)
    return DomainText(
        name=definition.name,
        requirements=definition.requirements(),
        types=tuple(parse_names(definition.nodes(":types"))),
        constants=tuple(parse_names(definition.nodes(":constants"))),
        predicates=_with_domain(definition.name, _declarations(definition.nodes(":predicates"))),
        functions=_with_domain(definition.name, _functions(definition.nodes(":functions"))),
        actions=read_actions(definition.sections),
        axioms=tuple(_axiom(group) for keyword, group in definition.sections if keyword == ":derived"),
        notes=tuple(definition.notes()),
        source=source,
    )


def _misspelt(name: str, valid: Collection[str]) -> bool:
    """Return whether a name is close to a valid name, unless one begins with the other (kiln, kiln8)."""
    close = difflib.get_close_matches(name, valid, cutoff=0.8)
    return any(not other.startswith(name) and not name.startswith(other) for other in close)


def parse_declaration(text: str, source: str | None) -> DeclarationText:
    """Read one declaration from its text, e.g. `(near ?a ?b - thing)`.

    Raises:
        ParseError: the text is not one declaration.
    """
    nodes = read(text, source)
    if len(nodes) != 1 or isinstance(nodes[0], Word):
        raise ParseError("one declaration is expected: (NAME ?x - TYPE)", place=Place(source, 1, 1))
    return _declaration(nodes[0])


def _declarations(nodes: Sequence[Node]) -> list[DeclarationText]:
    declared = [_declaration(node, distinct=False) for node in nodes]  # only the types of the parameters matter here
    return [d for d in declared if d.name != "="]  # some old files declare `=`, which is built in


def _functions(nodes: Sequence[Node]) -> list[DeclarationText]:
    """Return the declarations of functions.

    `- TYPE` after functions is the type of their values; without a type, the values are numbers as in PDDL 2.1.
    """
    found: list[DeclarationText] = []
    untyped: list[DeclarationText] = []
    position = 0
    while position < len(nodes):
        node = nodes[position]
        if isinstance(node, Word) and node.text == "-" and untyped:
            result = _result(nodes[position + 1 :], node)
            found += [replace(function, result=result) for function in untyped]
            untyped.clear()
            position += 2
        else:
            untyped.append(_declaration(node, distinct=False))
            position += 1
    return found + [replace(function, result="number") for function in untyped]


def _with_domain(domain: str, declarations: Iterable[DeclarationText]) -> tuple[DeclarationText, ...]:
    return tuple(replace(one, domain=domain) for one in declarations)


def _declaration(node: Node, *, distinct: bool = True) -> DeclarationText:
    if isinstance(node, Word):
        raise ParseError("a declaration is written in parentheses: (NAME ?x - TYPE)", place=node.place)
    head = node.head()
    if head is None or head[0] in "?:":
        raise ParseError("a declaration begins with a name: (NAME ?x - TYPE)", place=node.place)
    return DeclarationText(head, typed_variables(node.items[1:], distinct=distinct), node.place)


def _result(after: Sequence[Node], dash: Word) -> str:
    if not after:
        raise ParseError("'-' without a type after it", place=dash.place)
    kind = word(after[0], "a type")
    if kind.folded() not in UNSET:
        if nearest(kind.folded(), UNSET) is not None:
            message = "the result of a function is a value, not an object"
            raise ParseError(message, place=kind.place, found=kind.text, valid=UNSET)
        raise refused(OBJECT_FLUENTS, f"- {kind.text}", kind.place)
    return kind.folded()


def _axiom(group: Group) -> AxiomText:
    if len(group.items) != 3 or not isinstance(group.items[1], Group):
        raise ParseError("a derived predicate is written (:derived (NAME ?x - TYPE) CONDITION)", place=group.place)
    refuse_forms(group.items[2])
    return AxiomText(_declaration(group.items[1]), parse_condition(group.items[2]))
