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
from types import FrameType, UnionType
from typing import Annotated, Any, ClassVar, Literal, NewType, Union, get_args, get_origin

from knowledge_base.errors import InputError, Place, SchemaError, nearest, tolerated

_PLAIN: Mapping[object, str] = {bool: "boolean", int: "number", float: "number", str: "text"}
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


def type_of(annotation: object) -> str | None:
    """Return the type of plots for an annotation; `None` accepts any value.

    `int` and `float` are `number`, `bool` is `boolean`, `str` and literals are `text`. `NewType("CleanItem", str)` is
    the type `clean-item` of the domain, and so is `Annotated[str, "clean-item"]`. `X | None` has the type of `X`.
    """
    if isinstance(annotation, type) and annotation in _PLAIN:
        return _PLAIN[annotation]
    if get_origin(annotation) is Annotated:
        return next((one for one in get_args(annotation)[1:] if isinstance(one, str)), None)
    if isinstance(annotation, NewType):
        return domain_type(annotation.__name__) if _made_of(annotation) is str else None
    if get_origin(annotation) is Literal:
        kinds = {type_of(type(one)) for one in get_args(annotation)}
        return kinds.pop() if len(kinds) == 1 else None
    others = [one for one in members(annotation) if one is not type(None)]
    return type_of(others[0]) if len(others) == 1 and others[0] is not annotation else None


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
        raise SchemaError(f"the annotation of {what} cannot be evaluated: {error}") from error


def parameter_types(body: Callable[..., Any], own: int, names: Namespace) -> dict[str, str | None]:
    """Return the types of a function's parameters after the `own` first ones, by name."""
    given = list(inspect.signature(body).parameters.values())[own:]
    return {
        one.name: None if one.annotation is one.empty else type_of(evaluated(one.annotation, names, f"'{one.name}'"))
        for one in given
    }


def lower_name(class_name: str) -> str:
    """Return the name of a class in lower case, with underscores between words."""
    return _WORDS.sub("_", class_name).lower()


def is_class_variable(annotation: object) -> bool:
    """Return whether an annotation, which may be text, is a `ClassVar`."""
    if isinstance(annotation, str):
        return annotation.startswith(("ClassVar", "typing.ClassVar"))
    return annotation is ClassVar or get_origin(annotation) is ClassVar
