"""A PDDL problem file: what is there, what holds, and what is wanted, checked against a schema."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from knowledge_base.content import GEOMETRY, require_content
from knowledge_base.errors import ParseError, SchemaError, UnknownNameError
from knowledge_base.exchange.files import text_and_source
from knowledge_base.exchange.sections import Definition, read_definition, word
from knowledge_base.facts import Content, Delta, Fact, Value
from knowledge_base.language.check import check
from knowledge_base.language.expression import (
    TRUE,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Constant,
    Expression,
    Not,
    Term,
)
from knowledge_base.language.parser import parse_condition
from knowledge_base.language.sexpr import Node
from knowledge_base.language.typed_list import TypedName, parse_names
from knowledge_base.schema import ROOT_TYPE, Schema

_SECTIONS = {
    ":domain": None,
    ":requirements": None,
    ":objects": None,
    ":init": None,
    ":goal": None,
    ":metric": None,
    ":constraints": "conditions on whole plans are not judged",
    ":length": "it is not part of PDDL any more",
}


@dataclass(frozen=True, slots=True)
class ProblemText:
    """A problem as read; names are in lower case.

    Attributes:
        name: the problem's name.
        domain: the name of the domain it says it is for.
        objects: the things in the order of the file, with their types.
        init: what holds at first; what is not said does not hold.
        values: what functions are worth at first.
        goal: the condition wanted; true when the file has none.
        has_goal: whether the file says what is wanted.
    """

    name: str
    domain: str
    objects: Mapping[str, str]
    init: tuple[Fact, ...]
    values: Mapping[Fact, Content]
    goal: Expression
    has_goal: bool

    def delta(self) -> Delta:
        """The change from an empty world to the problem's first state."""
        return Delta(nodes=self.objects, added=self.init, values=self.values)


def read_problem(
    text_or_path: str | Path, schema: Schema, source: str | None = None, domain: str | None = None
) -> ProblemText:
    """Read a PDDL problem: a `Path` or a file's name, or the text itself.

    `:metric` and negative facts in `:init` are accepted and say nothing new.

    Args:
        text_or_path: a file, or text that begins with `(` or a comment.
        schema: the schema of its domain.
        source: the name of the text in messages.
        domain: the name of that domain, if the problem must be for it.

    Raises:
        InputError: the file cannot be read, or is for another domain.
        ParseError: the form is wrong, or a part of PDDL is used that is not supported.
        UnknownNameError: an undeclared type, predicate, function or object.
        SchemaError: a wrong number of arguments, a wrong type, an object declared in two ways.
    """
    text, source = text_and_source(text_or_path, source)
    definition = read_definition(text, source, "problem", _SECTIONS)
    definition.requirements()
    named = _domain(definition, domain)
    objects = _objects(parse_names(definition.nodes(":objects")), schema)
    init = _Init(schema, {**schema.constants, **objects})
    for node in definition.nodes(":init"):
        init.read(node)
    return ProblemText(
        name=definition.name,
        domain=named,
        objects=objects,
        init=tuple(init.facts),
        values=init.values,
        goal=_goal(definition, schema, init.objects),
        has_goal=bool(definition.nodes(":goal")),
    )


def _domain(definition: Definition, expected: str | None) -> str:
    nodes = definition.nodes(":domain")
    if len(nodes) != 1:
        raise ParseError("a problem says what it is for: (:domain NAME)", place=definition.place)
    named = word(nodes[0], "the domain's name")
    if expected is not None and named.folded() != expected:
        raise UnknownNameError(
            f"the problem is for the domain '{named.folded()}', not for '{expected}'",
            place=named.place, found=named.folded(), valid=(expected,),
        )  # fmt: skip
    return named.folded()


def _objects(names: Sequence[TypedName], schema: Schema) -> dict[str, str]:
    objects: dict[str, str] = {}
    for name, types, place in names:
        if len(types) > 1:
            raise SchemaError(f"the object '{name}' can have only one type", place=place)
        own = types[0] if types else ROOT_TYPE
        schema.require_type(own, place)
        known = objects.get(name) or schema.constants.get(name, own)
        if known != own:
            raise SchemaError(f"the object '{name}' is of type '{known}' already, not '{own}'", place=place)
        objects[name] = own
    return objects


def _goal(definition: Definition, schema: Schema, objects: Mapping[str, str]) -> Expression:
    nodes = definition.nodes(":goal")
    if not nodes:
        return TRUE
    if len(nodes) > 1:
        raise ParseError("a problem has one goal; join several with (and ...)", place=nodes[1].place)
    goal = parse_condition(nodes[0])
    check(goal, schema, objects=objects)
    return goal


class _Init:
    """Collects the first state, one element of `:init` after the other."""

    def __init__(self, schema: Schema, objects: Mapping[str, str]) -> None:
        self.schema = schema
        self.objects = objects
        self.facts: dict[Fact, None] = {}
        self.values: dict[Fact, Content] = {}

    def read(self, node: Node) -> None:
        e = parse_condition(node)
        check(e, self.schema, objects=self.objects)
        match e:
            case Atom(predicate) if self.schema.is_type(predicate, len(e.args)):
                raise SchemaError(f"'{predicate}' is a type; say it in :objects", place=e.place)
            case Atom(predicate, args):
                self.facts[Fact(predicate, _values(args))] = None
            case Not(Atom()):
                pass  # what is not said does not hold
            case Comparison("=", Call(function, args), said) if (content := _content(said)) is not None:
                fluent = Fact(function, _values(args))
                require_content(content, self.schema.result(function), fluent, said.place)
                self.values[fluent] = content
            case _:
                raise ParseError("':init' has facts and (= (FUNCTION ...) NUMBER)", place=e.place)


def _content(said: Term) -> Content | None:
    """A value as written, `(geometry 0.4 0.1)` too; `None` for what has to be worked out on a world."""
    match said:
        case Constant(value):
            return value
        case Arithmetic(operator, args) if operator == GEOMETRY:
            numbers = [a.value for a in args if isinstance(a, Constant) and isinstance(a.value, int | float)]
            return tuple(numbers) if len(numbers) == len(args) else None
        case _:
            return None


def _values(args: tuple[Term, ...]) -> tuple[Value, ...]:
    found = [a.value for a in args if isinstance(a, Constant)]
    if len(found) < len(args):
        place = next(a.place for a in args if not isinstance(a, Constant))
        raise ParseError("a fact's arguments are names and numbers", place=place)
    return tuple(found)
