"""Conditions, terms and effects as fields of a model: written as text in the one language, kept parsed.

A field accepts text or a parsed value and is written back as text. A plot read from YAML, built in Python or dumped to
JSON is therefore the same plot.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Annotated, Any, Self, TypeVar

from pydantic import ConfigDict, Discriminator, PlainSerializer, PlainValidator, PrivateAttr, WithJsonSchema

from dsc.model.reading import UNKNOWN_FORM, Form, FormPath
from knowledge_base.errors import InputError, Place
from knowledge_base.facts import Value
from knowledge_base.language.syntax.effect import AllOf, Effect, check_depth
from knowledge_base.language.syntax.expression import Constant, Expression, Term
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.text import parse_condition, parse_effect, parse_term, to_text

_Read = TypeVar("_Read")

_SYMBOL = re.compile(r"[a-z0-9_][a-z0-9_\-#~.]*", re.IGNORECASE)


class Frozen(Form):
    """Base of all model values: immutable, without unknown keys; aliased fields accept both spellings."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", populate_by_name=True, arbitrary_types_allowed=True, allow_inf_nan=False
    )


class Written(Frozen):
    """Base of the values of whole files: remembers the places of its parts in the text it was read from."""

    _places: Mapping[FormPath, Place] = PrivateAttr(default_factory=dict)

    def written_at(self, places: Mapping[FormPath, Place]) -> Self:
        """Return this value with the places of its parts."""
        self._places = places
        return self

    def place(self, path: FormPath) -> Place | None:
        """Return the place in the text of the part at `path`, or of the closest known part around it."""
        known: FormPath = ()
        for element in path:
            if (*known, element) in self._places:
                known = (*known, element)
            elif not isinstance(element, int):  # the short form of a list has no position
                break
        return self._places.get(known)


def by_key(*keys: str) -> Discriminator:
    """Return a discriminator for unions whose members each have one distinctive key."""
    return Discriminator(
        kind_by_key(*keys),
        custom_error_type=UNKNOWN_FORM,
        custom_error_message=f"one of the keys {', '.join(keys)} is needed here",
        custom_error_context={"keys": " ".join(keys)},
    )


def kind_by_key(*keys: str) -> Callable[[Any], str | None]:
    """Return a function that finds the first of the keys that the data have."""

    def kind(value: Any) -> str | None:
        present = value if isinstance(value, Mapping) else _written_keys(type(value))
        return next((key for key in keys if key in present), None)

    return kind


def _written_keys(kind: Any) -> set[str]:
    fields = getattr(kind, "model_fields", {})
    return {field.alias or name for name, field in fields.items()}


def _read(read: Callable[[Any], _Read], value: Any) -> _Read:
    """Return the result of a reader of the language; its errors become errors of validation."""
    try:
        return read(value)
    except InputError as error:
        raise ValueError(str(error)) from error


def _condition(value: Any) -> Expression:
    if isinstance(value, Expression):
        _read(check_depth, value)
        return value
    if not isinstance(value, str):
        raise ValueError(f"a condition was expected, as text such as (on ?o table); found {value!r}")
    return _read(parse_condition, value)


def _term(value: Any) -> Term:
    if isinstance(value, Term):
        _read(check_depth, value)
        return value
    if isinstance(value, bool | int | float):
        if not math.isfinite(value):
            raise ValueError(f"a finite number was expected; found {value!r}")
        return Constant(value)
    if not isinstance(value, str):
        raise ValueError(f"a value was expected: a constant, ?variable or (+ ?n 1); found {value!r}")
    return _read(parse_term, value) if value.startswith(("?", "(")) else _named(value)


@lru_cache(maxsize=4096)  # most names repeat in a sequence of plots, e.g. those made from plans
def _named(text: str) -> Constant:
    return Constant(text, quoted=not _SYMBOL.fullmatch(text))


def _effect(value: Any) -> Effect:
    if isinstance(value, Effect):
        _read(check_depth, value)
        return value
    if isinstance(value, list | tuple):
        return AllOf(tuple(map(_effect, value)))
    if not isinstance(value, str):
        raise ValueError(f"an effect was expected, as text such as (not (on ?o table)); found {value!r}")
    return _read(parse_effect, value)


_texts: IdentityCache[Expression | Effect, str] = IdentityCache()


def _text_out(part: Expression | Effect) -> str:
    """Return the text of a condition or effect, cached by identity: a plot and its expansion share conditions."""
    return _texts.find(part, None) or _texts.keep(part, None, to_text(part))


def _term_out(term: Term) -> Any:
    return term.value if isinstance(term, Constant) else to_text(term)


def constant(value: Value) -> Constant:
    """Return a value as a term; quote a text that is not a name."""
    return Constant(value, quoted=isinstance(value, str) and not _SYMBOL.fullmatch(value))


def _setting(value: object) -> Value:
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"a finite number was expected; found {value!r}")
    if isinstance(value, str | int | float | bool):
        return value
    raise ValueError(f"a number, a text or a truth value was expected; found {value!r}")


Setting = Annotated[Value, PlainValidator(_setting), WithJsonSchema({"type": ["string", "number", "boolean"]})]
"""A constant value."""

ConditionField = Annotated[
    Expression,
    PlainValidator(_condition),
    PlainSerializer(_text_out),
    WithJsonSchema({"type": "string", "description": "a condition, e.g. (and (on ?o table) (cup ?o))"}),
]
"""A condition; chart variables, parameters and event attributes bind all its variables."""

TermField = Annotated[
    Term,
    PlainValidator(_term),
    PlainSerializer(_term_out),
    WithJsonSchema(
        {
            "type": ["string", "number", "boolean"],
            "description": "a constant, a variable such as ?item or ?event.level, or arithmetic such as (+ ?n 1)",
        }
    ),
]
"""A value: a constant, a variable, or arithmetic over them."""

EffectField = Annotated[
    Effect,
    PlainValidator(_effect),
    PlainSerializer(_text_out),
    WithJsonSchema(
        {
            "type": ["string", "array"],
            "items": {"type": "string"},
            "description": "a PDDL effect, e.g. (and (unreachable ?item) (not (graspable ?item)))",
        }
    ),
]
"""A change of the knowledge base in the form of a PDDL effect."""
