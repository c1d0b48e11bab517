"""Types of plots from annotations of Python, for parameters of skills and attributes of outcomes (S2.11).

Annotations are evaluated when the decorator of a skill runs. Names may come from the module, or from the functions and
classes around the skill. Names that are imported only for a type checker do not exist then.
"""

from __future__ import annotations

import builtins
import inspect
import re
import sys
from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass
from enum import EnumType
from functools import cache
from types import FrameType, UnionType
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, NewType, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel

from dsc.data_types import ANY, DataType, data_type
from knowledge_base.errors import InputError, Place, SchemaError, nearest, tolerated
from knowledge_base.spelling import is_plain_name
from knowledge_base.user_objects import described

_PLAIN: Mapping[object, str] = {bool: "boolean", int: "integer", float: "number", str: "text"}
_WORDS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
Namespace = Mapping[str, Any]


def names_around(module: dict[str, Any]) -> Namespace:
    """Return the names that annotations may use now: those of a module, and of its functions that are running."""
    around = list[dict[str, Any]]()
    frame: FrameType | None = sys._getframe(1)  # noqa: SLF001  # the only way to the names of an enclosing function
    while frame is not None:
        if frame.f_globals is module and frame.f_locals is not module:
            around.append(frame.f_locals)
        frame = frame.f_back
    return ChainMap(*around, module, vars(builtins))


@contextmanager
def class_statement(kind: type) -> Iterator[Namespace]:
    """Yield the names that annotations of a new class may use, and give errors of the block the line of its statement.

    The block runs while Python makes the class.
    """
    frame: FrameType | None = sys._getframe(2)  # noqa: SLF001  # the only way to the names around the statement
    while frame is not None and frame.f_globals.get("__name__") != kind.__module__:
        frame = frame.f_back  # a metaclass
    with tolerated():
        try:
            yield names_around(sys._getframe(2).f_globals if frame is None else frame.f_globals)  # noqa: SLF001
        except InputError as error:
            if frame is not None:
                error.place = error.place or Place(frame.f_code.co_filename, frame.f_lineno)
            raise


FoundRecords = dict[str, dict[str, str | None]]
"""Records that annotations name: the types of the fields by name."""


def type_of(annotation: object, records: FoundRecords | None = None) -> str | None:
    """Return the type of plots for an annotation; `None` accepts any value.

    `int` is `integer`, `float` is `number`, `bool` is `boolean`, `str` is `text`. `NewType("CleanItem", str)` is the
    type `clean-item` of the domain. The text in `Annotated[str, "clean-item"]` is a type as plots write it. A `Literal`
    or an `Enum` is a choice, `X | None` is `optional`, `list[X]` and `dict[str, X]` contain values of the type of `X`.
    A dataclass or a model of pydantic is a record, which is added to `records`.

    Raises:
        InputError: the text of `Annotated` is not a type, or two classes of records have one name.
    """
    if isinstance(annotation, type) and annotation in _PLAIN:
        return _PLAIN[annotation]
    if get_origin(annotation) is Annotated:
        said = next((one for one in get_args(annotation)[1:] if isinstance(one, str)), None)
        return type_of(get_args(annotation)[0], records) if said is None else str(data_type(said))
    if isinstance(annotation, NewType):
        return domain_type(annotation.__name__) if _made_of(annotation) is str else None
    return _compound_type(annotation, {} if records is None else records)


def _choice(values: tuple[object, ...]) -> str | None:
    plain = tuple(one for one in values if isinstance(one, str | int | float))
    return str(DataType("choice", values=plain)) if plain and len(plain) == len(values) else None


def _compound_type(annotation: object, records: FoundRecords) -> str | None:
    """Return the type of a choice, record, list, map or optional value; `None` for another annotation."""
    if is_record(annotation):
        return _record(annotation, records)
    if isinstance(annotation, EnumType):
        annotation = Literal.__getitem__(tuple(one.value for one in annotation))  # type: ignore[var-annotated]
    if get_origin(annotation) is Literal:
        return _choice(get_args(annotation))
    origin, inside = get_origin(annotation), get_args(annotation)
    if origin is list or annotation is list:
        return f"list of {(type_of(inside[0], records) if inside else None) or ANY}"
    if (origin is dict or annotation is dict) and (not inside or inside[0] is str):
        return f"map of {(type_of(inside[1], records) if inside else None) or ANY}"
    others = [one for one in members(annotation) if one is not type(None)]
    if len(others) != 1 or others[0] is annotation:
        return None
    kind = type_of(others[0], records)
    return None if kind is None else f"optional {kind}"


def add_records(records: FoundRecords, more: Mapping[str, Mapping[str, str | None]]) -> None:
    """Add records; raise `SchemaError` for a second record of one name with other fields."""
    for name, own in more.items():
        known = records.setdefault(name, dict(own))
        if known != own:
            said = f"two records are named '{name}', with the fields {', '.join(known)} and {', '.join(own)}"
            raise SchemaError(said, found=name)


def is_record(annotation: object) -> bool:
    """Return whether an annotation is a class of records: a dataclass, or a model of pydantic."""
    return isinstance(annotation, type) and (is_dataclass(annotation) or issubclass(annotation, BaseModel))


class RecordField(NamedTuple):
    """A field of a record: its annotation, and whether it has no default."""

    annotation: object
    required: bool


@cache
def record_fields(kind: Any) -> dict[str, RecordField]:
    """Return the fields of a class of records by name; the first call is made where the names of annotations exist.

    Raises:
        SchemaError: an annotation names something that does not exist, or a field has no name of plots.
    """
    module = vars(sys.modules[kind.__module__])
    try:
        hints = get_type_hints(kind, localns=dict(names_around(module)), include_extras=True)
    except NameError as error:
        message = f"an annotation of {kind.__qualname__} names '{error.name}', which does not exist when it is read"
        raise SchemaError(message, found=str(error.name)) from None
    if issubclass(kind, BaseModel):
        found = {name: RecordField(hints[name], one.is_required()) for name, one in kind.model_fields.items()}
    else:
        found = {
            one.name: RecordField(hints[one.name], one.default is MISSING and one.default_factory is MISSING)
            for one in fields(kind)
        }
    for name in found:
        if not is_plain_name(name):
            message = f"field '{name}' of {kind.__qualname__} cannot be read in plots, which have lower-case names"
            raise SchemaError(f"{message}; write '{lower_name(name)}'", found=name)
    return found


def _record(kind: Any, records: FoundRecords) -> str:
    name = domain_type(kind.__name__)
    if name in records and not records[name]:  # its own fields contain it
        return name
    known = records.get(name)
    records[name] = {}
    found = {}
    for field, one in record_fields(kind).items():
        text = type_of(one.annotation, records)
        given = one.required or not text or text.startswith("optional ")
        found[field] = text if given else f"optional {text}"
    if known is not None and known != found:
        raise SchemaError(
            f"two classes of records are named '{name}': {kind.__qualname__} has other fields", found=name
        )
    records[name] = found
    return name


def domain_type(class_name: str) -> str:
    """Return the type of the domain for the name of a class: `clean-item` for `CleanItem`."""
    return _WORDS.sub("-", class_name).lower()


def type_class(type_name: str) -> str:
    """Return a name of a class for a type of the domain; `domain_type` inverts it, unless the type has other signs."""
    words = re.split(r"\W+", type_name)
    made = "".join(word[:1].upper() + word[1:] for word in words)
    return made if made.isidentifier() else f"T{made}"


def _made_of(new_type: NewType) -> object:
    below: object = new_type
    while isinstance(below, NewType):
        below = below.__supertype__
    return below


def members(annotation: object) -> Iterator[object]:
    """Yield the members of a union in order, or another annotation itself."""
    annotation = getattr(annotation, "__value__", annotation)  # of an alias made by `type`
    if get_origin(annotation) in {Union, UnionType}:
        for one in get_args(annotation):
            yield from members(one)
    else:
        yield annotation


def evaluated(annotation: object, names: Namespace, what: str) -> object:
    """Return the value of an annotation, which may be text.

    Raises:
        SchemaError: a name does not exist, or the annotation is not valid Python.
    """
    if not isinstance(annotation, str):
        return annotation
    try:
        return eval(annotation, {}, names)  # noqa: S307  # the text is the user's program
    except NameError as error:
        name = str(error.name)
        message = f"the annotation of {what} names '{name}', which does not exist when the class is made"
        found = nearest(name, names.keys() - vars(builtins).keys())
        hint = f"; did you mean '{found}'?" if found else "; define or import it before, also outside TYPE_CHECKING"
        raise SchemaError(message + hint, found=name) from None
    except Exception as error:  # annotations may contain any expression
        raise SchemaError(f"the annotation of {what} cannot be evaluated: {described(error)}") from error


def parameter_annotations(body: Callable[..., Any], own: int, names: Namespace) -> dict[str, object]:
    """Return the annotations of a function's parameters after the `own` first ones, by name; `Any` without one.

    Raises:
        SchemaError: a parameter is `*args` or `**kw`, or an annotation cannot be evaluated.
    """
    found: dict[str, object] = {}
    for one in list(inspect.signature(body).parameters.values())[own:]:
        if one.kind in {one.VAR_POSITIONAL, one.VAR_KEYWORD}:
            stars = "*" if one.kind is one.VAR_POSITIONAL else "**"
            message = f"plots pass arguments by name, and '{stars}{one.name}' receives none"
            raise SchemaError(f"{message}: name the parameters, or take a list", found=one.name)
        found[one.name] = Any if one.annotation is one.empty else evaluated(one.annotation, names, f"'{one.name}'")
    return found


def lower_name(class_name: str) -> str:
    """Return the name of a class in lower case, with underscores between words."""
    return _WORDS.sub("_", class_name).lower()


def is_class_variable(annotation: object) -> bool:
    """Return whether an annotation, which may be text, is a `ClassVar`."""
    if isinstance(annotation, str):
        return annotation.startswith(("ClassVar", "typing.ClassVar"))
    return annotation is ClassVar or get_origin(annotation) is ClassVar
