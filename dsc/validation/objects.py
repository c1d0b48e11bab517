"""Objects that plots name: each is known from the start, and has the type of its place."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from dsc.data_types import data_type
from dsc.validation.subject import Types
from dsc.validation.type_checks import inside_optional
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.language.syntax.effect import ForEach, Form, parts_of_form
from knowledge_base.language.syntax.expression import Atom, Call, Comparison, Constant, Exists, Forall, Term, Variable
from knowledge_base.world.schema import Schema

NOTHING: Types = {}


class KnownObjects:
    """The objects that a run begins with. A name that none of them has is unknown, if others of its type are known.

    Args:
        schema: the types of objects, and the constants.
        objects: the types of all other objects by name.
    """

    def __init__(self, schema: Schema, objects: Mapping[str, str]) -> None:
        self._schema = schema
        self._types = {**objects, **schema.constants}

    def mistakes(self, form: Form, scope: Types) -> Iterator[InputError]:
        """Yield an error for each name in a condition, effect or term that is unknown or of another type.

        Args:
            form: the condition, effect or term; its predicates and functions are declared.
            scope: types of the variables by name.
        """
        match form:
            case Atom(predicate, (arg,)) if self._schema.is_type(predicate, 1):
                yield from self._of(arg, (predicate,), scope)
            case Atom(name, args) | Call(name, args):
                declared = self._schema.predicates if isinstance(form, Atom) else self._schema.functions
                parameters = declared[name].parameters if name in declared else ()
                for parameter, arg in zip(parameters, args, strict=False):
                    yield from self._of(arg, parameter.types, scope)
            case Comparison("=" | "!=", left, right):
                for one, other in ((left, right), (right, left)):
                    kind = scope.get(other.name) if isinstance(other, Variable) else None
                    yield from () if kind is None else self._of(one, (kind,), scope)
            case Exists(variables) | Forall(variables) | ForEach(variables):
                own = {one.name: one.types[0] if len(one.types) == 1 else None for one in variables}
                scope = {**scope, **own}
            case _:
                pass
        for part in parts_of_form(form):
            yield from self.mistakes(part, scope)

    def mistake(self, name: str, kind: str, place: Place | None = None, scope: Types = NOTHING) -> InputError | None:
        """Return the error about a name as a value of a type; `None` for a valid name or another type."""
        inner = inside_optional(data_type(kind))
        return self._mistake(name, (inner.name,), place, scope) if inner.kind == "name" else None

    def _of(self, term: Term, wanted: Collection[str], scope: Types) -> Iterator[InputError]:
        if isinstance(term, Constant) and isinstance(term.value, str) and not term.quoted:
            mistake = self._mistake(term.value, wanted or (ROOT_TYPE,), term.place, scope)
            yield from () if mistake is None else (mistake,)

    def _mistake(self, name: str, wanted: Collection[str], place: Place | None, scope: Types) -> InputError | None:
        if not all(one in self._schema.types for one in wanted):
            return None
        kinds, given = " or ".join(wanted), self._types.get(name)
        if given is not None:
            if any(self._schema.is_a(given, one) or self._schema.is_a(one, given) for one in wanted):
                return None
            return SchemaError(f"'{name}' is of type {given}, not of type {kinds}", place=place, found=name)
        valid = [one for one, kind in self._types.items() if any(self._schema.is_a(kind, want) for want in wanted)]
        if not valid:
            return None  # a run finds all objects of the type
        said = f"there is no object '{name}' of type {kinds}"
        if name in scope:
            return SchemaError(f"{said}; write ?{name} for the value of the variable", place=place, found=name)
        return UnknownNameError(said, place=place, found=name, valid=valid)
