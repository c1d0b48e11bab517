"""Checks of conditions and effects against a schema before a run: names, numbers of arguments and types."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Literal

from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.facts import GEOMETRY, Value
from knowledge_base.language.checking.binding import check_answers, row_variables, unbound_error
from knowledge_base.language.checking.vocabulary import Computing, Signature, Vocabulary
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When, check_depth
from knowledge_base.language.syntax.expression import (
    TRUE,
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    TypedVariable,
    Variable,
)
from knowledge_base.language.syntax.rewriting import opposite
from knowledge_base.spelling import number_text

Free = Literal["error", "answers"]


def check(
    e: Expression,
    schema: Vocabulary,
    variables: Mapping[str, str | None] | None = None,
    free: Free = "error",
    objects: Mapping[str, str] | None = None,
    *,
    live: bool = True,
) -> None:
    """Raise an error with its place unless `e` can be evaluated on worlds of `schema`.

    Args:
        e: the condition.
        schema: the declarations.
        variables: the variables that will be bound, with their types; `None` is an unknown type.
        free: `error` if other free variables are an error, `answers` if they are the answers of a query.
        objects: the known objects with their types; names in `e` must be among them. With `None`, every name is
            accepted.
        live: whether `e` may read relations that a running program provides.

    Raises:
        UnknownNameError: an undeclared predicate, function, type, variable or object.
        SchemaError: a wrong number of arguments, or a type that no object can match.
        InputError: a variable of a query occurs only under `not` or in a comparison; or the nesting is too deep.
    """
    check_depth(e)
    checker = _Checker(schema, objects, variables or {}, free, live=live)
    checker.condition(e)
    if free == "answers":
        check_answers(schema.expanded(e), frozenset(variables or ()), schema)


def check_effect(
    effect: Effect,
    schema: Vocabulary,
    variables: Mapping[str, str | None] | None = None,
    objects: Mapping[str, str] | None = None,
    *,
    live: bool = True,
) -> None:
    """Raise an error with its place unless `effect` can be applied to worlds of `schema`.

    Arguments and errors as for `check`. A type as an effect is a `SchemaError`, since objects keep their type.
    """
    check_depth(effect)
    _Checker(schema, objects, variables or {}, "error", live=live).effect(effect)


def check_term(term: Term, schema: Vocabulary, variables: Mapping[str, str | None] | None = None) -> None:
    """Raise an error with its place unless `term` has a value on worlds of `schema`.

    Arguments and errors as for `check`.
    """
    check_depth(term)
    _Checker(schema, None, variables or {}, "error").term(term)


def check_parameters(parameters: tuple[TypedVariable, ...], schema: Vocabulary) -> dict[str, str | None]:
    """Return the parameters with their types, in the form of the argument `variables` of `check`.

    The type of a parameter with several types (`either`) is `None`.

    Raises:
        UnknownNameError: a type is not declared.
    """
    for parameter in parameters:
        for type_name in parameter.types:
            schema.require_argument_type(type_name, parameter.place)
    return {p.name: _single(p.types) for p in parameters}


def check_reads(computed: Computing, schema: Vocabulary) -> None:
    """Raise an error with its place unless all reads of the computed predicate are valid; errors as for `check`."""
    checker = _Checker(schema, None, check_parameters(computed.parameters, schema), "error")
    for read in computed.reads:
        if isinstance(read, Atom):
            checker.condition(read)
        else:
            checker.term(read)


def check_arity(signature: Signature, count: int, place: Place | None = None) -> None:
    """Raise `SchemaError` unless `signature` has `count` parameters."""
    if signature.arity != count:
        raise SchemaError(
            f"'{signature.name}' takes {number_text(signature.arity, 'argument')}, as in {signature}; found {count}",
            place=place,
        )


def value_fits(value: Value, wanted: tuple[str, ...]) -> bool:
    """Return whether a value that is not an object's name may be an argument of one of the `wanted` types."""
    if isinstance(value, bool):
        return "boolean" in wanted
    if isinstance(value, str):
        return "text" in wanted
    return isinstance(value, int | float) and "number" in wanted


def _term_text(term: Term) -> str:
    """Return the text of a term for messages."""
    match term:
        case Variable(name):
            return f"'?{name}'"
        case Constant(value):
            return f"'{value}'"
        case _:
            return "the argument"


def _single(types: tuple[str, ...]) -> str | None:
    if not types:
        return "object"
    return types[0] if len(types) == 1 else None


class _Checker:
    """Check of one expression; `scope` contains the visible variables with their possible types."""

    def __init__(
        self,
        schema: Vocabulary,
        objects: Mapping[str, str] | None,
        variables: Mapping[str, str | None],
        free: Free,
        *,
        live: bool = True,
    ) -> None:
        self.live = live
        self.schema = schema
        self.objects = objects
        self.free = free
        self.scope: dict[str, tuple[str, ...] | None] = {
            name: None if type_name is None else (type_name,) for name, type_name in variables.items()
        }

    def condition(self, e: Expression) -> None:
        match e:
            case Atom():
                self.atom(e)
            case Comparison():
                self.comparison(e)
            case Exists(variables, body) | Forall(variables, body):
                with self.inside(variables, body if isinstance(e, Exists) else opposite(body)):
                    self.condition(body)
            case And(parts) | Or(parts):
                for part in parts:
                    self.condition(part)
            case Not(body):
                self.condition(body)
            case Imply(premise, conclusion):
                self.condition(premise)
                self.condition(conclusion)

    def effect(self, effect: Effect) -> None:
        match effect:
            case Add(atom) | Delete(atom):
                if self.schema.is_type(atom.predicate, len(atom.args)):
                    raise SchemaError(f"'{atom.predicate}' is a type; things keep theirs", place=atom.place)
                self.arguments(self.schema.told(atom.predicate, atom.place), atom)
            case AllOf(parts):
                for part in parts:
                    self.effect(part)
            case ForEach(variables, inner):
                with self.inside(variables, TRUE):
                    self.effect(inner)
            case When(condition, inner):
                self.condition(condition)
                self.effect(inner)
            case NumericEffect():
                self.assignment(effect)

    def assignment(self, effect: NumericEffect) -> None:
        """Require that the value has the type of the function; operators other than `assign` require numbers."""
        result = self.schema.result(effect.call.function, effect.call.place)
        self.term(effect.call)
        if effect.operator != "assign" or result == "number":
            self.number(effect.call, effect.operator)
            self.number(effect.value, effect.operator)
            return
        self.term(effect.value)
        types = self.types_of(effect.value)
        if types is not None and result not in types:
            raise SchemaError(
                f"'{effect.call.function}' has values of type {result}, and {_term_text(effect.value)} is of type "
                f"{' or '.join(types)}",
                place=effect.value.place or effect.place,
            )

    def atom(self, atom: Atom) -> None:
        if self.schema.is_type(atom.predicate, len(atom.args)):
            self.term(atom.args[0])
            return
        signature = self.schema.predicate(atom.predicate, atom.place)
        if signature.live and not self.live:
            message = f"'{atom.predicate}' describes the running program; goals and planning actions cannot read it"
            raise SchemaError(message, place=atom.place)
        self.arguments(signature, atom)

    def comparison(self, e: Comparison) -> None:
        if e.operator in ("=", "!="):
            self.term(e.left)
            self.term(e.right)
            return
        self.number(e.left, e.operator)
        self.number(e.right, e.operator)

    def term(self, term: Term) -> None:
        match term:
            case Variable(name):
                self.known_variable(term, name)
            case Constant():
                self.known_constant(term)
            case Call(function):
                self.arguments(self.schema.function(function, term.place), term)
            case Arithmetic(operator, args):
                for arg in args:
                    self.number(arg, operator)

    def number(self, term: Term, operator: str) -> None:
        """Check a term that is used as a number; the type of a variable must allow numbers."""
        self.term(term)
        types = self.types_of(term)
        word = isinstance(term, Constant) and isinstance(term.value, str | bool)
        if word or (types is not None and "number" not in types):
            said, functions = f"'{operator}' works on numbers, and {_term_text(term)} is none", self.schema.functions
            name = str(term.value) if isinstance(term, Constant) else ""
            if name in functions:
                said += f"; the value of the function is {functions[name]}"
            raise SchemaError(said, place=term.place)

    def arguments(self, signature: Signature, used: Atom | Call) -> None:
        check_arity(signature, len(used.args), used.place)
        for parameter, arg in zip(signature.parameters, used.args, strict=True):
            if not (signature.live and isinstance(arg, Constant)):
                self.term(arg)
                self.fits(arg, parameter, signature)

    def fits(self, arg: Term, parameter: TypedVariable, signature: Signature) -> None:
        wanted = parameter.types or ("object",)
        types = self.types_of(arg)
        if types is None or any(self.compatible(arg, t, w) for t in types for w in wanted):
            return
        if isinstance(arg, Constant) and types == ("text",):
            raise self.unknown_object(str(arg.value), arg.place)
        raise SchemaError(
            f"{_term_text(arg)} is of type {' or '.join(types)}, but '?{parameter.name}' of '{signature.name}' is of "
            f"type {' or '.join(wanted)}",
            place=arg.place or signature.place,
        )

    def compatible(self, arg: Term, given: str, wanted: str) -> bool:
        """Return whether the type of an object is `wanted` or one of its subtypes.

        For a variable, a supertype of `wanted` is accepted too: its value may still have the right type.
        """
        return self.schema.is_a(given, wanted) or (isinstance(arg, Variable) and self.schema.is_a(wanted, given))

    def types_of(self, term: Term) -> tuple[str, ...] | None:
        """Return the possible types of the term's value; `None` when the types are unknown."""
        match term:
            case Variable(name):
                return self.scope.get(name)
            case Constant(value, quoted):
                return self.types_of_value(value, quoted=quoted)
            case Call(function):
                return (self.schema.result(function, term.place),)
            case Arithmetic(operator):
                return (GEOMETRY if operator == GEOMETRY else "number",)

    def types_of_value(self, value: Value, *, quoted: bool) -> tuple[str, ...] | None:
        if isinstance(value, bool):
            return ("boolean",)
        if not isinstance(value, str):
            return ("number",)
        # Do not test for an empty mapping: a world would have to count its objects.
        known = self.schema.constants.get(value) or (None if self.objects is None else self.objects.get(value))
        if known is not None:
            return (known, "text") if quoted else (known,)
        return ("text",) if quoted and self.objects is not None else None

    def known_variable(self, variable: Variable, name: str) -> None:
        if name in self.scope or self.free == "answers":
            return
        raise unbound_error(name, variable.place, self.scope)

    def known_constant(self, constant: Constant) -> None:
        value = constant.value
        if self.objects is None or constant.quoted or not isinstance(value, str):
            return
        if value not in self.objects and value not in self.schema.constants:
            raise self.unknown_object(value, constant.place)

    def unknown_object(self, name: str, place: Place | None) -> InputError:
        """Return the error for a name that is not a known object."""
        if name[0].isdigit():
            return SchemaError(
                f"'{name}' is no number: a number has a point and no unit, as in 1.5", place=place, found=name
            )
        if name in self.schema.functions:
            said = f"there is no object '{name}'; the value of the function is {self.schema.functions[name]}"
            return SchemaError(said, place=place, found=name)
        message = f"there is no object '{name}' (text is written in quotes)"
        return UnknownNameError(message, place=place, found=name, valid=self.names())

    def names(self) -> tuple[str, ...]:
        """Return the names of all known objects."""
        return (*(self.objects or ()), *self.schema.constants)

    @contextmanager
    def inside(self, variables: tuple[TypedVariable, ...], body: Expression) -> Iterator[None]:
        """Open the scope of `(exists variables body)` for a block; values in rows have any type."""
        for variable in variables:
            for type_name in variable.types:
                self.schema.require_type(type_name, variable.place)
        outer = self.scope
        self.scope = {**outer, **{v.name: v.types or ("object",) for v in variables}}
        if self.live:
            self.scope.update(dict.fromkeys(row_variables(variables, body, self.schema)))
        try:
            yield
        finally:
            self.scope = outer
