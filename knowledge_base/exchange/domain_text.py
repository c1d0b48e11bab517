"""A PDDL domain file as read: declarations and actions in their written form, nothing resolved yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from knowledge_base.content import UNSET
from knowledge_base.errors import ParseError, Place, SchemaError
from knowledge_base.exchange.files import text_and_source
from knowledge_base.exchange.sections import Definition, read_definition, word
from knowledge_base.language.effect import NO_EFFECT, Effect
from knowledge_base.language.expression import TRUE, Expression, TypedVariable
from knowledge_base.language.parser import parse_condition, parse_effect, parse_variables
from knowledge_base.language.sexpr import Group, Node, Word, read
from knowledge_base.language.typed_list import TypedName, parse_names, typed_variables

_SECTIONS = {
    ":requirements": None,
    ":types": None,
    ":constants": None,
    ":predicates": None,
    ":functions": None,
    ":action": None,
    ":durative-action": "actions have no duration here",
    ":derived": "declare a predicate and say when it changes",
    ":constraints": "conditions on whole plans are not judged",
}
_ACTION_PARTS = (":parameters", ":precondition", ":effect")


@dataclass(frozen=True, slots=True)
class DeclarationText:
    """A predicate or function as declared: `(on ?a ?b - item)`; `result` is what a function is worth."""

    name: str
    parameters: tuple[TypedVariable, ...]
    place: Place
    result: str | None = None


@dataclass(frozen=True, slots=True)
class ActionText:
    """A planning action as written; what is left out is `()`, true, or no effect."""

    name: str
    parameters: tuple[TypedVariable, ...]
    precondition: Expression
    effect: Effect
    place: Place = field(compare=False)


@dataclass(frozen=True, slots=True)
class DomainText:
    """All of a domain file, in the order of the file; names are in lower case."""

    name: str
    requirements: tuple[str, ...]
    types: tuple[TypedName, ...]
    constants: tuple[TypedName, ...]
    predicates: tuple[DeclarationText, ...]
    functions: tuple[DeclarationText, ...]
    actions: tuple[ActionText, ...]


def read_domain(text_or_path: str | Path, source: str | None = None) -> DomainText:
    """Read a PDDL domain: a `Path` or a file's name, or the text itself.

    Args:
        text_or_path: a file, or text that begins with `(` or a comment.
        source: the name of the text in messages.

    Raises:
        InputError: the file cannot be read.
        ParseError: the form is wrong, or a part of PDDL is used that is not supported.
        SchemaError: two actions have one name.
    """
    return parse_domain(*text_and_source(text_or_path, source))


def parse_domain(text: str, source: str | None = None) -> DomainText:
    """Read a PDDL domain from its text; `source` names it in messages.

    Raises:
        ParseError: the form is wrong, or a part of PDDL is used that is not supported.
        SchemaError: two actions have one name.
    """
    definition = read_definition(text, source, "domain", _SECTIONS)
    return DomainText(
        name=definition.name,
        requirements=definition.requirements(),
        types=tuple(parse_names(definition.nodes(":types"))),
        constants=tuple(parse_names(definition.nodes(":constants"))),
        predicates=tuple(_declarations(definition.nodes(":predicates"))),
        functions=tuple(_functions(definition.nodes(":functions"))),
        actions=_actions(definition),
    )


def parse_declaration(text: str, source: str | None = None) -> DeclarationText:
    """Read one declaration from its text, e.g. `(near ?a ?b - thing)`.

    Raises:
        ParseError: it has another form.
    """
    nodes = read(text, source)
    if len(nodes) != 1 or isinstance(nodes[0], Word):
        raise ParseError("one declaration is expected: (NAME ?x - TYPE)", place=Place(source, 1, 1))
    return _declaration(nodes[0])


def _declarations(nodes: Sequence[Node]) -> list[DeclarationText]:
    declared = [_declaration(node) for node in nodes]
    return [d for d in declared if d.name != "="]  # declared by old files, though the language has it


def _functions(nodes: Sequence[Node]) -> list[DeclarationText]:
    """Declarations, which `- TYPE` after them makes worth that; without it they are numeric, as in PDDL 2.1."""
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
            untyped.append(_declaration(node))
            position += 1
    return found + [replace(function, result="number") for function in untyped]


def _declaration(node: Node) -> DeclarationText:
    if isinstance(node, Word):
        raise ParseError("a declaration is written in parentheses: (NAME ?x - TYPE)", place=node.place)
    head = node.head()
    if head is None or head[0] in "?:":
        raise ParseError("a declaration begins with a name: (NAME ?x - TYPE)", place=node.place)
    return DeclarationText(head, typed_variables(node.items[1:]), node.place)


def _result(after: Sequence[Node], dash: Word) -> str:
    if not after:
        raise ParseError("'-' without a type after it", place=dash.place)
    kind = word(after[0], "a type")
    if kind.folded() not in UNSET:
        raise ParseError("a function is worth a value, not a thing", place=kind.place, found=kind.text, valid=UNSET)
    return kind.folded()


def _actions(definition: Definition) -> tuple[ActionText, ...]:
    actions: dict[str, ActionText] = {}
    for keyword, group in definition.sections:
        if keyword != ":action":
            continue
        action = _action(group)
        if action.name in actions:
            first = actions[action.name].place
            raise SchemaError(
                f"the action '{action.name}' is defined a second time; first at {first}", place=action.place
            )
        actions[action.name] = action
    return tuple(actions.values())


def _action(group: Group) -> ActionText:
    if len(group.items) < 2:
        raise ParseError("an action has a name: (:action NAME ...)", place=group.place)
    name = word(group.items[1], "the action's name")
    if name.text.startswith(":"):
        raise ParseError("an action has a name: (:action NAME ...)", place=name.place)
    parts = _action_parts(group.items[2:], name)
    return ActionText(
        name=name.folded(),
        parameters=parse_variables(parts[":parameters"]) if ":parameters" in parts else (),
        precondition=parse_condition(parts[":precondition"]) if ":precondition" in parts else TRUE,
        effect=parse_effect(parts[":effect"]) if ":effect" in parts else NO_EFFECT,
        place=name.place,
    )


def _action_parts(nodes: Sequence[Node], name: Word) -> dict[str, Node]:
    parts: dict[str, Node] = {}
    for position in range(0, len(nodes), 2):
        key = word(nodes[position], f"a keyword of the action '{name.text}'")
        keyword = key.folded()
        if keyword not in _ACTION_PARTS:
            raise ParseError(
                f"an action has no part '{key.text}'", place=key.place, found=key.text, valid=_ACTION_PARTS
            )
        if keyword in parts:
            raise ParseError(f"a second '{keyword}' of the action '{name.text}'", place=key.place)
        if position + 1 == len(nodes):
            raise ParseError(f"'{keyword}' is followed by nothing", place=key.place)
        parts[keyword] = nodes[position + 1]
    return parts
