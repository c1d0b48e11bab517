"""A PDDL problem file: objects, initial state and goal, checked against a vocabulary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from knowledge_base.errors import ParseError, Place, SchemaError, UnknownNameError
from knowledge_base.facts import GEOMETRY, Content, Delta, Fact, Value, require_content
from knowledge_base.language.checking.check import check
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, Vocabulary
from knowledge_base.language.syntax.expression import (
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
from knowledge_base.language.syntax.sexpr import Group, Node, TypedName, Word, parse_names
from knowledge_base.language.syntax.text import parse_condition, parse_term
from knowledge_base.pddl.definition import TIMED_INITIAL, Definition, read_definition, refuse_forms, refused, word
from knowledge_base.pddl.files import text_and_source
from knowledge_base.spelling import is_number

_SECTIONS = (":domain", ":requirements", ":objects", ":init", ":goal", ":metric", ":length")
TOTAL_TIME = Call("total-time")
"""The duration of the whole plan, in a metric; no domain declares this function."""
_DIRECTIONS = ("minimize", "maximize")


@dataclass(frozen=True, slots=True)
class Metric:
    """The measure of plans: the value of `term` at the end of the plan. `term` may contain `TOTAL_TIME`."""

    direction: Literal["minimize", "maximize"]
    term: Term


@dataclass(frozen=True, slots=True)
class ProblemText:
    """A problem as read; names are in lower case.

    Attributes:
        name: name of the problem.
        domain: name of the domain that the file declares.
        objects: the objects in the order of the file, with their types.
        init: the facts of the initial state; all other facts are false.
        values: values of functions in the initial state.
        goal: the condition to reach; true when the file has no goal.
        has_goal: whether the file has a goal.
        metric: the measure of plans, if the file has one.
        notes: remarks without influence on the result, each with its place.
    """

    name: str
    domain: str
    objects: Mapping[str, str]
    init: tuple[Fact, ...]
    values: Mapping[Fact, Content]
    goal: Expression
    has_goal: bool
    metric: Metric | None = None
    notes: tuple[str, ...] = ()

    def delta(self) -> Delta:
        """Return the change from an empty world to the initial state of the problem."""
        return Delta(nodes=self.objects, added=self.init, values=self.values)


def read_problem(
    text_or_path: str | Path, schema: Vocabulary, source: str | None = None, domain: str | None = None
) -> ProblemText:
    """Read a PDDL problem from a file (a `Path` or a file name), or from its text.

    Negative facts in `:init`, and the section `:length`, are accepted and ignored. An initial state that contradicts
    itself is refused.

    Args:
        text_or_path: a file, or text that begins with `(` or a comment.
        schema: the schema of the problem's domain.
        source: name of the text in messages.
        domain: name of the problem's domain. A problem for another domain is read too, with a note, if it matches the
            schema: domains of public files are often renamed.

    Raises:
        InputError: the file cannot be read.
        ParseError: the form is wrong.
        UnsupportedConstructError: the file uses a construct that no planner here supports.
        UnknownNameError: an undeclared type, predicate, function or object; or the problem is for another domain and
            does not match the schema.
        SchemaError: a wrong number of arguments, a wrong type, or an object declared with two types. It is also raised
            if `:init` has two values of one function, or a fact and its negation.
    """
    text, source = text_and_source(text_or_path, source)
    return parse_problem(text, schema, source, domain)


def parse_problem(text: str, schema: Vocabulary, source: str | None = None, domain: str | None = None) -> ProblemText:
    """Read a PDDL problem from its text; arguments and errors as for `read_problem`."""
    definition = read_definition(text, source, "problem", _SECTIONS)
    named = _domain(definition)
    if domain is None or named.folded() == domain:
        return _problem(definition, named, schema)
    said = f"the problem is for the domain '{named.folded()}', not for '{domain}'"
    try:
        problem = _problem(definition, named, schema)
    except (UnknownNameError, SchemaError) as error:
        raise UnknownNameError(
            f"{said}, and does not fit it: {error.message}", place=named.place, found=named.folded(), valid=(domain,)
        ) from error
    return replace(problem, notes=(*problem.notes, f"{named.place}: {said}, but fits it"))


def _domain(definition: Definition) -> Word:
    nodes = definition.nodes(":domain")
    if len(nodes) != 1:
        raise ParseError("a problem says what it is for: (:domain NAME)", place=definition.place)
    return word(nodes[0], "the domain's name")


def _problem(definition: Definition, named: Word, schema: Vocabulary) -> ProblemText:
    objects = _objects(parse_names(definition.nodes(":objects")), schema)
    init = _Init(schema, {**schema.constants, **objects})
    for node in definition.nodes(":init"):
        init.read(node)
    return ProblemText(
        name=definition.name,
        domain=named.folded(),
        objects=objects,
        init=tuple(init.facts),
        values=init.values,
        goal=_goal(definition, schema, init.objects),
        has_goal=bool(definition.nodes(":goal")),
        metric=_metric(definition, schema, init.objects),
        notes=tuple(definition.notes()),
    )


def _objects(names: Sequence[TypedName], schema: Vocabulary) -> dict[str, str]:
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


def _goal(definition: Definition, schema: Vocabulary, objects: Mapping[str, str]) -> Expression:
    nodes = definition.nodes(":goal")
    if not nodes:
        return TRUE
    if len(nodes) > 1:
        raise ParseError("a problem has one goal; join several with (and ...)", place=nodes[1].place)
    refuse_forms(nodes[0])
    goal = parse_condition(nodes[0])
    check(goal, schema, objects=objects)
    return goal


def _metric(definition: Definition, schema: Vocabulary, objects: Mapping[str, str]) -> Metric | None:
    nodes = definition.nodes(":metric")
    if not nodes:
        return None
    direction = word(nodes[0], "'minimize' or 'maximize'")
    if direction.folded() not in _DIRECTIONS:
        raise ParseError(
            f"a metric begins with 'minimize' or 'maximize', not '{direction.text}'",
            place=direction.place, found=direction.text, valid=_DIRECTIONS,
        )  # fmt: skip
    if len(nodes) != 2:
        raise ParseError("a metric is written (:metric minimize NUMBER)", place=direction.place)
    term = parse_term(nodes[1])
    without_total_time = _with_total_time(term, Constant(0))  # no domain declares `total-time`
    check(Comparison("<=", without_total_time, Constant(0), place=definition.place), schema, objects=objects)
    return Metric("minimize" if direction.folded() == "minimize" else "maximize", _with_total_time(term, TOTAL_TIME))


def _with_total_time(term: Term, value: Call | Constant) -> Term:
    """Return the term with `total-time`, with or without parentheses, replaced by `value`."""
    match term:
        case Constant(TOTAL_TIME.function) | Call(TOTAL_TIME.function, ()):
            return replace(value, place=term.place)
        case Arithmetic(_, args):
            return replace(term, args=tuple(_with_total_time(arg, value) for arg in args))
        case _:
            return term


class _Init:
    """Reader of the initial state, for one element of `:init` after the other."""

    def __init__(self, schema: Vocabulary, objects: Mapping[str, str]) -> None:
        self.schema = schema
        self.objects = objects
        self.facts: dict[Fact, None] = {}
        self.values: dict[Fact, Content] = {}
        self._stated: dict[Fact, tuple[Content | bool, Place | None]] = {}  # values, or whether a fact is true

    def read(self, node: Node) -> None:
        if isinstance(node, Group) and node.head() == "and":
            for part in node.items[1:]:
                self.read(part)
            return
        _refuse_timed(node)
        refuse_forms(node)
        e = parse_condition(node)
        check(e, self.schema, objects=self.objects)
        match e:
            case Atom(predicate) if self.schema.is_type(predicate, len(e.args)):
                self.confirm(predicate, _values(e.args)[0], e.place)
            case Atom(predicate, args):
                fact = Fact(predicate, _values(args))
                self._state(fact, e.place, stated=True)
                self.facts[fact] = None
            case Not(Atom(predicate, args)):  # facts that are not listed are false
                self._state(Fact(predicate, _values(args)), e.place, stated=False)
            case Comparison("=", Call(function, args), said) if (content := _content(said)) is not None:
                fluent = Fact(function, _values(args))
                require_content(content, self.schema.result(function), fluent, said.place)
                self._state(fluent, e.place, stated=content)
                self.values[fluent] = content
            case _:
                raise ParseError("':init' has facts and (= (FUNCTION ...) NUMBER)", place=e.place)

    def _state(self, what: Fact, place: Place | None, *, stated: Content | bool) -> None:
        """Store a value, or the truth of a fact; raise `SchemaError` if the initial state has stated another one."""
        before, where = self._stated.setdefault(what, (stated, place))
        if before != stated:
            message = (
                f"':init' contradicts itself: {what} is {_text_of(stated)} here, and {_text_of(before)} at {where}"
            )
            raise SchemaError(message, place=place, found=str(what))

    def confirm(self, type_name: str, thing: Value, place: Place | None) -> None:
        """Check `(truck t1)` in `:init`, which may repeat the type of t1 but cannot change it."""
        if not self.schema.is_a(self.objects.get(str(thing), ""), type_name):
            raise SchemaError(f"'{type_name}' is a type; say it in :objects", place=place)


def _refuse_timed(node: Node) -> None:
    """Refuse `(at 5 (open door))`; a fact never has a number as first and a group as second argument."""
    if not isinstance(node, Group) or node.head() != "at" or len(node.items) != 3:
        return
    time, fact = node.items[1:]
    if isinstance(time, Word) and is_number(time.text) and isinstance(fact, Group):
        raise refused(TIMED_INITIAL, f"at {time.text}", node.place)


def _text_of(stated: object) -> str:
    return str(stated).lower() if isinstance(stated, bool) else str(stated)


def _content(said: Term) -> Content | None:
    """Return a value as written, including `(geometry 0.4 0.1)`; `None` for a term that needs a world."""
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
