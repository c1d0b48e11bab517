"""Conditions, terms and effects as fields of a model: written as text, stored parsed.

A field accepts text or a parsed value, and is written back as text. A plot from YAML, from Python or from JSON is
therefore equal to the original.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, Generic, Self, TypeVar, Union, cast, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PrivateAttr,
    Tag,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from dsc.model.data_forms import literal, literal_parts, literal_value
from dsc.model.reading import UNKNOWN_FORM, Form, FormPath
from knowledge_base.errors import InputError, Place
from knowledge_base.facts import Value
from knowledge_base.language.syntax.effect import AllOf, Effect, check_depth
from knowledge_base.language.syntax.expression import Call, Constant, Expression, Term
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.text import parse_condition, parse_effect, parse_term, to_text

_Read = TypeVar("_Read")
_Part = TypeVar("_Part")

_SYMBOL = re.compile(r"[a-z0-9_][a-z0-9_\-#~.]*", re.IGNORECASE)


class Frozen(Form):
    """Base of all values of the model: immutable, without unknown keys; a field with an alias accepts both names."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", populate_by_name=True, arbitrary_types_allowed=True, allow_inf_nan=False
    )


class Written(Frozen):
    """Base of values that are read from a whole file; stores the place of each part in the file's text."""

    _places: Mapping[FormPath, Place] = PrivateAttr(default_factory=dict)

    def written_at(self, places: Mapping[FormPath, Place]) -> Self:
        """Store the places of this value's parts by path, and return this value."""
        self._places = places
        return self

    def place(self, path: FormPath) -> Place | None:
        """Return the place of the part at `path`, or of the closest outer part with a known place; else `None`."""
        known: FormPath = ()
        for element in path:
            if (*known, element) in self._places:
                known = (*known, element)
            elif not isinstance(element, int):  # a list of one may be written without brackets
                break
        return self._places.get(known)


class ByKey:
    """Annotation of a union of models: a mapping is read as the model whose first field is one of its keys.

    The union is thus the only list of its models: `Annotated[Assign | Tell, ByKey()]` reads `{assign: ...}`.
    """

    def __get_pydantic_core_schema__(self, union: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema of the union, discriminated by the keys."""
        models = {first_key(model): model for model in get_args(union)}
        keys = Discriminator(
            kind_by_key(*models),
            custom_error_type=UNKNOWN_FORM,
            custom_error_message=f"one of the keys {', '.join(models)} is needed here",
            custom_error_context={"keys": " ".join(models)},
        )
        tagged = tuple(Annotated[model, Tag(key)] for key, model in models.items())
        return handler.generate_schema(Annotated[Union.__getitem__(tagged), keys])


def first_key(model: type[BaseModel]) -> str:
    """Return the key under which the first field of a model is written, e.g. `if` for `Choose`."""
    name, field = next(iter(model.model_fields.items()))
    return field.alias or name


def kind_by_key(*keys: str) -> Callable[[Any], str | None]:
    """Return a function that returns the first of `keys` in a mapping or model value, or `None` if none is in it."""

    def kind(value: Any) -> str | None:
        present = value if isinstance(value, Mapping) else _written_keys(type(value))
        for key in keys:
            if key in present:
                return key
        return None

    return kind


def _written_keys(kind: Any) -> set[str]:
    fields = getattr(kind, "model_fields", {})
    return {field.alias or name for name, field in fields.items()}


def _read(read: Callable[[Any], _Read], value: Any) -> _Read:
    """Return the result of the parser `read` for a value; raise `ValueError` for pydantic if the parser fails."""
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
    if isinstance(value, list | tuple):
        return Call("list", tuple(map(_term, value)))
    if isinstance(value, Mapping) and all(isinstance(name, str) for name in value):
        return literal({name: _term(part) for name, part in value.items()})
    if not isinstance(value, str):
        raise ValueError(f"a value was expected: a constant, ?variable or (+ ?n 1); found {value!r}")
    is_form = value[:1] in _MARKS and (value[0] != '"' or is_quoted(value))
    return _read(parse_term, value) if is_form else _named(value)


_MARKS = frozenset('?("')
"""First characters of a term that is not the text itself."""


def is_quoted(text: str) -> bool:
    """Return whether the text has quotes as in a condition; its value is the text inside them."""
    return len(text) > 1 and text[0] == text[-1] == '"'


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


def text_of(part: Expression | Effect) -> str:
    """Return the text of a condition or effect.

    The text is cached by the identity of the object, because a plot and its expansion share conditions, and so do
    successive plans.
    """
    return _texts.find(part, None) or _texts.keep(part, None, to_text(part))


def term_text(term: Term) -> str:
    """Return a term in the notation of plots: `(+ ?n 1)`, `[cup1, ?item]`, `{item: ?item, score: 0.5}`."""
    parts = _parts(term)
    if parts is None:
        return to_text(term)
    texts = {name: term_text(part) for name, part in parts.items()}
    if isinstance(term, Call) and term.function == "list":
        return f"[{', '.join(texts.values())}]"
    return f"{{{', '.join(f'{name}: {text}' for name, text in texts.items())}}}"


def _parts(term: Term) -> dict[str, Term] | None:
    """Return the parts of a list or record; `None` for another term, and for a record that validation refuses."""
    try:
        return literal_parts(term)
    except InputError:
        return None


def _term_out(term: Term) -> Any:
    if not isinstance(term, Constant):
        is_valid = isinstance(term, Call) and _parts(term) is not None
        return literal_value(term, _term_out) if is_valid else to_text(term)
    value = term.value
    return _in_quotes(value) if isinstance(value, str) and value[:1] in _MARKS else value


def _setting_out(value: Value) -> Value:
    return _in_quotes(value) if isinstance(value, str) and is_quoted(value) else value


def _in_quotes(text: str) -> str:
    return to_text(Constant(text, quoted=True))


def constant(value: Value) -> Constant:
    """Return a value as a constant term; a text that is not a name is quoted."""
    return Constant(value, quoted=isinstance(value, str) and not _SYMBOL.fullmatch(value))


def _setting(value: object) -> Value:
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"a finite number was expected; found {value!r}")
    if isinstance(value, str) and is_quoted(value):
        return cast("Constant", _read(parse_term, value)).value
    if isinstance(value, str | int | float | bool):
        return value
    raise ValueError(f"a number, a text or a truth value was expected; found {value!r}")


@dataclass(frozen=True, eq=False)
class _Text(Generic[_Part]):
    """Marks a field whose value is read from text and is written back as text.

    Pydantic's own markers also make a schema for the class of the value. For conditions that took half of the time in
    which the model is imported.
    """

    read: Callable[[object], _Part]
    write: Callable[[_Part], Any]
    description: JsonSchemaValue

    def __get_pydantic_core_schema__(self, _source: object, _handler: GetCoreSchemaHandler) -> CoreSchema:
        written = core_schema.plain_serializer_function_ser_schema(self.write)
        return core_schema.no_info_plain_validator_function(self.read, serialization=written)

    def __get_pydantic_json_schema__(self, _schema: CoreSchema, _handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return dict(self.description)


Setting = Annotated[Value, _Text(_setting, _setting_out, {"type": ["string", "number", "boolean"]})]
"""Field type of a constant value; a text may have quotes, as in a condition."""

ConditionField = Annotated[
    Expression,
    _Text(_condition, text_of, {"type": "string", "description": "a condition, e.g. (and (on ?o table) (cup ?o))"}),
]
"""Field type of a condition; each free variable must be a chart variable, a parameter or an event attribute."""

TermField = Annotated[
    Term,
    _Text(
        _term,
        _term_out,
        {
            "type": ["string", "number", "boolean", "array", "object"],
            "description": "a constant, a variable such as ?item or ?event.level, (+ ?n 1), a list or a record",
        },
    ),
]
"""Field type of a term: a constant, a variable or arithmetic."""

EffectField = Annotated[
    Effect,
    _Text(
        _effect,
        text_of,
        {
            "type": ["string", "array"],
            "items": {"type": "string"},
            "description": "a PDDL effect, e.g. (and (unreachable ?item) (not (graspable ?item)))",
        },
    ),
]
"""Field type of a change of the knowledge base, written as a PDDL effect."""
