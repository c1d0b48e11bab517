"""Checks of conditions, effects and terms of a plot against the schema, the types of data, and the known objects."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TypeVar

from dsc.data_types import DataType, data_type
from dsc.engine.membership import asked_states, settle
from dsc.errors import Finding
from dsc.model.data_forms import DataReader, plain_condition, plain_effect, plain_term
from dsc.model.plot import Path
from dsc.validation.objects import KnownObjects
from dsc.validation.subject import Subject, Types
from dsc.validation.type_checks import TypeChecker, inside_optional, language_type
from dsc.validation.type_reader import TypeReader
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.checking.binding import check_answers, unbound_error
from knowledge_base.language.checking.check import check, check_effect, check_term
from knowledge_base.language.syntax.effect import Effect, Form, mentioned
from knowledge_base.language.syntax.expression import (
    Comparison,
    Constant,
    Expression,
    Term,
    Variable,
    free_variables,
    parts_of,
)
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.schema import Schema

_F = TypeVar("_F", Expression, Effect, Term)
_DECLARE = "the domain's `:constants`, problem files and the initial knowledge declare objects"


class LanguageChecker:
    """Check of conditions, effects and terms in a scope: the types of all readable names.

    Args:
        subject: the plot.
        types: the comparison of types.
    """

    def __init__(self, subject: Subject, types: TypeChecker) -> None:
        self._subject, self._schema, self._types = subject, subject.schema, types
        self._objects: KnownObjects | None = None
        if subject.schema is not None and subject.objects is not None:
            self._objects = KnownObjects(subject.schema, subject.objects)

    def condition(
        self, condition: Expression, names: Types, path: Path, *, planned: bool = False, guard: bool = False
    ) -> Iterator[Finding]:
        """Yield findings about a condition.

        Args:
            condition: the condition.
            names: the types of readable names.
            path: the path of the condition.
            planned: whether planning reads the condition, so that it may be recursive.
            guard: whether the condition is a guard; only guards of dialect `dsc` test active states.
        """
        asked = asked_states(condition)
        if asked and self._subject.strict and not guard:
            message = "only the `when` of a transition without `bind` tests active states"
            yield self._subject.finding(path, "condition", message, "test the state there", found=asked[0])
        for name in asked:
            if name not in self._subject.names:
                message, valid = f"there is no state '{name}'", self._subject.names
                yield self._subject.finding(path, "condition", message, found=name, valid=valid)
        condition = settle(condition, lambda _: True)
        read = yield from self._plain(condition, names, path, "condition", plain_condition)
        if read is None:
            return
        plain, names = read
        yield from self._check_comparisons(plain, names, path)

        def require(schema: Schema, known: Types) -> None:
            check(plain, schema, known)
            if not planned:
                schema.require_defined(plain)

        yield from self._evaluable(plain, names, path, "condition", require)

    def answers(self, condition: Expression, names: Types, wanted: Sequence[str], path: Path) -> Iterator[Finding]:
        """Yield a finding if a condition without other findings can only test one of the variables `wanted`."""
        schema = self._schema
        if schema is None:
            return
        with suppress(InputError):
            plain = plain_condition(condition, TypeReader(names, self._subject.records))
            check(plain, schema, self._mask_unknown(names, schema))
            try:
                check_answers(schema.expanded(plain), frozenset(names) - frozenset(wanted), schema)
            except InputError as error:
                yield self._subject.caught(error, path, "bindings")

    def effect(self, effect: Effect, names: Types, path: Path) -> Iterator[Finding]:
        """Yield findings about an effect."""
        read = yield from self._plain(effect, names, path, "effect", plain_effect)
        if read is not None:
            plain, names = read
            yield from self._evaluable(
                plain, names, path, "effect", lambda schema, known: check_effect(plain, schema, known)
            )

    def term(self, term: Term, names: Types, path: Path) -> Generator[Finding, None, Types | None]:
        """Yield findings about a term; return the scope with the parts that it reads, or `None` after an error."""
        if isinstance(term, Variable):
            read = yield from self._part(term, names, path)
        else:
            read = yield from self._plain(term, names, path, "term", plain_term)
        if read is None:
            return None
        plain, names = read
        unknown = sorted(free_variables(plain) - names.keys())
        for name in unknown:
            message = f"there is no variable '?{name}' here"
            yield self._subject.finding(path, "declared-variable", message, found=name, valid=names)
        if not unknown and self._subject.strict:
            yield from self._evaluable(
                plain, names, path, "term", lambda schema, known: check_term(plain, schema, known)
            )
        return names

    def unknown_object(self, name: str, kind: str, names: Types, path: Path) -> Iterator[Finding]:
        """Yield a finding about a name that no known object of a type has."""
        mistake = None if self._objects is None else self._objects.mistake(name, kind, scope=names)
        if mistake is not None:
            yield self._known_object(mistake, path)

    def _known_object(self, mistake: InputError, path: Path) -> Finding:
        fix = _DECLARE if isinstance(mistake, UnknownNameError) else ""
        return self._subject.caught(mistake, path, "known-object", fix)

    def _plain(
        self, form: _F, names: Types, path: Path, rule: str, convert: Callable[[_F, DataReader], _F]
    ) -> Generator[Finding, None, tuple[_F, Types] | None]:
        """Return a form without access to data, and the scope with the parts that it reads; `None` after an error."""
        reader = TypeReader(names, self._subject.records)
        try:
            form = convert(form, reader)
        except InputError as error:
            yield self._subject.caught(error, path, rule)
            return None
        return form, {**names, **reader.read}

    def _part(
        self, variable: Variable, names: Types, path: Path
    ) -> Generator[Finding, None, tuple[Term, Types] | None]:
        """Return a variable, and the scope with the type of the part that it reads; `None` after an error."""
        reader = TypeReader(names, self._subject.records)
        try:
            if reader.leads_to_part(variable.name):
                names = {**names, variable.name: reader.kind(variable.name, variable.place)}
        except InputError as error:
            yield self._subject.caught(error, path, "term")
            return None
        return variable, names

    def _evaluable(
        self, form: Form, names: Types, path: Path, rule: str, require: Callable[[Schema, Types], None]
    ) -> Iterator[Finding]:
        if self._schema is None:
            for name in sorted(mentioned(form) - names.keys()):
                yield self._subject.caught(unbound_error(name, None, names), path, rule)
            return
        try:
            require(self._schema, self._mask_unknown(names, self._schema))
        except InputError as error:
            yield self._subject.caught(error, path, rule)
            return
        for mistake in () if self._objects is None else self._objects.mistakes(form, names):
            yield self._known_object(mistake, path)

    def _check_comparisons(self, condition: Expression, names: Types, path: Path) -> Iterator[Finding]:
        """Yield findings about comparisons with choices and other words, whose types conditions do not know."""
        if isinstance(condition, Comparison):
            for term, other in ((condition.left, condition.right), (condition.right, condition.left)):
                kind = names.get(term.name) if isinstance(term, Variable) else None
                if kind is None:
                    continue
                if condition.operator in {"=", "!="}:
                    yield from self._impossible_values(term, data_type(kind), other, path)
                elif self._types.is_word(data_type(kind)):
                    message = f"'{condition.operator}' works on numbers, and {to_text(term)} is of type {kind}"
                    yield self._subject.finding(path, "condition", message)
        for part in parts_of(condition):
            if isinstance(part, Expression):
                yield from self._check_comparisons(part, names, path)

    def _impossible_values(self, term: Term, kind: DataType, other: Term, path: Path) -> Iterator[Finding]:
        """Yield a finding about a choice that is compared with a value that it never has."""
        chosen = inside_optional(kind)
        if chosen.kind == "choice" and isinstance(other, Constant) and other.value not in chosen.values:
            valid = [str(value) for value in chosen.values]
            message = f"{to_text(term)} is never {to_text(other)}"
            yield self._subject.finding(path, "condition", message, found=str(other.value), valid=valid)

    @staticmethod
    def _mask_unknown(names: Types, schema: Schema) -> Mapping[str, str | None]:
        """Return the scope with `None` for each type that conditions do not know."""
        return {name: kind and language_type(kind, schema) for name, kind in names.items()}
