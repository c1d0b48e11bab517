"""The names that a condition on pushed values may use, and the check of conditions before their evaluation (S2.4)."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.components.checks import ARGUMENT_KINDS, Check, Series
from dsc.data_types import ANY, data_type
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.evaluation.terms import ORDER
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Constant,
    Expression,
    Imply,
    Not,
    Or,
    Term,
    Variable,
    free_variables,
)
from knowledge_base.language.syntax.rewriting import inside, name_in
from knowledge_base.language.syntax.text import to_text

SILENT = "silent"
"""Name of the check `(silent port seconds)`: nothing has come from a port for that time."""
_NUMBERS = frozenset({"number", "integer"})
_SERIES = (Series, Series.__name__)
_RESULTS: Mapping[Any, str] = {bool: "boolean", "bool": "boolean", float: "number", "float": "number"}
"""Kinds of results by annotation, which is a text in a module with `from __future__ import annotations`."""


@dataclass(frozen=True, slots=True)
class ValueVocabulary:
    """The names of a condition on values.

    Attributes:
        ports: the types of the values of each push port, by the port's name in the condition.
        checks: the functions by name.
        variables: the kinds of the variables that have values by name, empty if unknown; `None` accepts any name.
        who: the beginning of messages about unknown values, e.g. `the component pushes no`.
        knowledge: the kinds of the functions of the knowledge base, whose present values the condition may read.
        any_check: whether components in other programs may have further checks.
    """

    ports: Mapping[str, Mapping[str, str | None]]
    checks: Mapping[str, Check]
    variables: Mapping[str, str] | None
    who: str
    knowledge: Mapping[str, str] = field(default_factory=dict)
    any_check: bool = False

    def check(self, e: Expression) -> None:
        """Raise an error unless the condition can be evaluated.

        Raises:
            InputError: a part of the condition has another form, or a value of another type.
            UnknownNameError: there is no such port, value, check or variable.
        """
        match e:
            case And(parts) | Or(parts):
                for part in parts:
                    self.check(part)
            case Not(body):
                self.check(body)
            case Imply(premise, conclusion):
                self.check(premise)
                self.check(conclusion)
            case Comparison():
                self._check_comparison(e)
            case Atom("silent", args):
                self._check_silence(args, e)
            case Atom(name, args):
                self._check_atom(name, args, e)
            case _:
                raise InputError(f"a condition on values has no quantifiers: {to_text(e)}", place=e.place)

    def is_of_knowledge(self, function: str) -> bool:
        """Return whether a function is one of the knowledge base; a check of the same name precedes."""
        return function in self.knowledge and function not in self.checks

    def require_knowledge(self, form: Expression) -> None:
        """Raise an error for a check in a form that reads no value, and so belongs to the knowledge base.

        Raises:
            InputError: the form uses a check, or has the form of one.
            UnknownNameError: a variable has no value, or `silent` names no port.
        """
        self.require_variables(form)
        for one in inside(form):
            name = name_in(one)
            if isinstance(one, Atom) and name == SILENT:
                self.check(one)
            if name in self.checks and name not in self.knowledge:
                message = f"'{name}' is a check of pushed values, and {to_text(one)} reads none"
                raise InputError(message, place=one.place, found=name)

    def require_variables(self, form: Expression | Term) -> None:
        """Raise `UnknownNameError` for a variable without a value."""
        for name in free_variables(form):
            if self.variables is not None and name not in self.variables:
                message = f"there is no value for '?{name}' in `values`"
                raise UnknownNameError(message, place=form.place, found=name, valid=self.variables)

    def _check_comparison(self, e: Comparison) -> None:
        kinds = {term: self._kind(term) for term in (e.left, e.right)}
        for term, kind in kinds.items():
            if e.operator in ORDER and not _fits(kind, "number"):
                raise self._no_number(e, term, kind)
        if e.operator not in ORDER and not _comparable(*(kinds[term] for term in (e.left, e.right))):
            message = f"{to_text(e)} compares {kinds[e.left]} with {kinds[e.right]}, which are never equal"
            raise InputError(message, place=e.place, found=to_text(e.right))
        for value, other in ((e.left, e.right), (e.right, e.left)):
            self._check_choice(value, other)

    def _check_choice(self, value: Term, other: Term) -> None:
        """Raise `UnknownNameError` if a constant is not among the choices of the value with which it is compared."""
        if self._reads_value(value) and isinstance(value, Constant) and isinstance(other, Constant):
            port, _, name = str(value.value).rpartition(".")
            choices = data_type(self.ports[port][name] or ANY).values
            if choices and other.value not in choices and not self._reads_value(other):
                message, valid = f"'{value.value}' is never {to_text(other)}", [str(one) for one in choices]
                raise UnknownNameError(message, place=other.place, found=str(other.value), valid=valid)

    def _check_silence(self, args: tuple[Term, ...], e: Atom) -> None:
        match args:
            case (Constant(str(port), False) as name, Constant(int() | float() as seconds)) if (
                not isinstance(seconds, bool) and seconds > 0
            ):
                if self._is_value(port):
                    message = f"{to_text(e)}: '{port}' is a value; a port is silent, as in (silent {_port(port)} 2)"
                    raise InputError(message, place=name.place, found=port)
                if port not in self.ports:
                    raise UnknownNameError(f"{self.who} '{port}'", place=name.place, found=port, valid=self.ports)
            case _:
                raise InputError(f"{to_text(e)} is not of the form (silent port seconds)", place=e.place)

    def _check_atom(self, name: str, args: tuple[Term, ...], e: Atom) -> None:
        if self._is_value(name):
            message = f"({name}) is a value and no condition: compare it, as in (= {name} true)"
            raise InputError(message, place=e.place, found=name)
        kind = self._kind_of_call(name, args, e)
        if kind in _NUMBERS:
            raise InputError(f"{to_text(e)} is a number and no condition: compare it", place=e.place, found=name)

    # -- terms -------------------------------------------------------------------------------------------

    def _kind(self, term: Term) -> str:  # noqa: PLR0911  # a table by form
        """Return the kind of a term's value, e.g. `number`; empty if it is unknown."""
        match term:
            case Constant(bool()):
                return "boolean"
            case Constant(int() | float()):
                return "number"
            case Constant(str(name), False) if "." in name or name in self.ports:
                return self._kind_of_value(name, term)
            case Constant():
                return "text"
            case Variable(name):
                self.require_variables(term)
                return (self.variables or {}).get(name, "")
            case Call("list", args) | Arithmetic("geometry", args):
                return self._kind_of_parts(args, "list", term)
            case Arithmetic(_, args):
                return self._kind_of_parts(args, "number", term)
            case Call(name, args):
                return self._kind_of_call(name, args, term)

    def _kind_of_parts(self, args: tuple[Term, ...], kind: str, term: Term) -> str:
        for arg in args:
            found = self._kind(arg)
            if not _fits(found, "number"):
                raise self._no_number(term, arg, found)
        return kind

    def _kind_of_value(self, name: str, term: Constant) -> str:
        port, _, value = name.rpartition(".")
        if name in self.ports:
            valid = ", ".join(f"{name}.{one}" for one in self.ports[name])
            raise InputError(f"'{name}' is a port, whose values are {valid}", place=term.place, found=name)
        if value not in self.ports.get(port, ()):
            valid_names = [f"{one}.{value}" for one, values in self.ports.items() for value in values]
            raise UnknownNameError(f"{self.who} '{name}'", place=term.place, found=name, valid=valid_names)
        return kind_of_type(self.ports[port][value])

    def _kind_of_call(self, name: str, args: tuple[Term, ...], form: Call | Atom) -> str:
        if name in self.checks:
            return self._kind_of_check(name, self.checks[name], args, form)
        if isinstance(form, Call) and self.is_of_knowledge(name):
            self.require_variables(form)
            return self.knowledge[name]
        if not self.any_check:
            valid = (SILENT, *self.checks, *self.knowledge)
            message = f"there is no check{' or function' if self.knowledge else ''} '{name}'"
            raise UnknownNameError(message, place=form.place, found=name, valid=valid)
        for arg in args:
            self._kind(arg)
        return ""

    def _kind_of_check(self, name: str, check: Check, args: tuple[Term, ...], form: Call | Atom) -> str:
        signature = inspect.signature(check)
        try:
            signature.bind(*args)
        except TypeError as error:
            wanted = " ".join((name, *signature.parameters))
            raise InputError(f"{to_text(form)}: {error}, as in ({wanted})", place=form.place, found=name) from error
        wanted_kind = ARGUMENT_KINDS.get(check, "")
        for arg, parameter in zip(args, signature.parameters.values(), strict=False):
            kind = self._kind(arg)
            said = f"{to_text(form)}: '{parameter.name}' is"
            if parameter.annotation in _SERIES and not self._reads_value(arg):
                raise InputError(f"{said} a value of a port, not {to_text(arg)}", place=form.place, found=name)
            if wanted_kind and not _fits(kind, wanted_kind):
                of = "a number" if wanted_kind == "number" else "a list of numbers"
                message = f"{said} {of}, and {to_text(arg)} is of type {kind}"
                raise InputError(message, place=form.place, found=to_text(arg))
        if wanted_kind == "number":
            _try(check, args, form)
        return _RESULTS.get(signature.return_annotation, "")

    def _reads_value(self, term: Term) -> bool:
        return isinstance(term, Constant) and isinstance(term.value, str) and self._is_value(term.value)

    def _is_value(self, name: str) -> bool:
        port, _, value = name.rpartition(".")
        return value in self.ports.get(port, ())

    @staticmethod
    def _no_number(form: Expression | Term, term: Term, kind: str) -> InputError:
        message = f"{to_text(form)} needs numbers, and {to_text(term)} is of type {kind}"
        return InputError(message, place=form.place, found=to_text(term))


def _fits(kind: str, wanted: str) -> bool:
    return kind in {"", wanted} or (wanted == "number" and kind in _NUMBERS)


def _comparable(kind: str, other: str) -> bool:
    return not kind or _fits(other, kind) or _fits(kind, other)


def _port(value: str) -> str:
    return value.rpartition(".")[0]


def _try(check: Check, args: tuple[Term, ...], form: Call | Atom) -> None:
    """Raise the check's error about its constants, such as exchanged bounds; without other constants, do nothing."""
    sample = Series("a value")
    sample.kept.append((0.0, 0.0))
    constants = [one.value for one in args[1:] if isinstance(one, Constant) and not isinstance(one.value, str)]
    if len(constants) < len(args) - 1:
        return
    try:
        check(sample, *constants)
    except InputError as error:
        raise InputError(f"{to_text(form)}: {error.message}", place=form.place) from error


def kinds_of(values: Mapping[str, object]) -> dict[str, str]:
    """Return the kinds of the values of variables by name, empty for an unknown kind.

    Raises:
        InputError: a variable has no value, e.g. as a geometry was never set.
    """
    for name, value in values.items():
        if value is None:
            raise InputError(f"'?{name}' has no value: the term in `values` is unset", found=name)
    return {name: kind_of_value(value) for name, value in values.items()}


def kind_of_value(value: object) -> str:
    """Return the kind of a value; empty for an unknown kind."""
    kinds = ((bool, "boolean"), (int | float, "number"), (str, "text"), (list | tuple, "list"))
    return next((name for types, name in kinds if isinstance(value, types)), "")


def kind_of_type(declared: str | None) -> str:
    """Return the kind of the values of a declared type; empty for a type that has values of several kinds."""
    if declared is None:
        return ""
    kind = data_type(declared).kind
    if kind in {"optional", "choice", "name"}:
        return "text" if declared == "text" else ""
    return "list" if kind == "geometry" else kind
