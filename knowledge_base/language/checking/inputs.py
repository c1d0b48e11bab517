"""Checks of arguments in public methods, with one-line errors, for callers without static type checks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TypeVar

from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.facts import VALUE_TYPES, Delta, Fact, Value
from knowledge_base.language.syntax.expression import Expression, free_variables
from knowledge_base.user_objects import shown

_NO_CHANGE = Delta()
_Part = TypeVar("_Part")


def require(value: object, kinds: type | tuple[type, ...], wanted: str) -> None:
    """Raise `InputError` unless `value` has one of the types.

    `wanted` is the beginning of the message, e.g. `a schema is a Schema`.
    """
    if not isinstance(value, kinds):
        raise InputError(f"{wanted}, not {shown(value)[:60]}")


def require_several(value: object, what: str) -> None:
    """Raise `InputError` unless `value` is iterable and not text; `what` is the word for its items in the message."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise InputError(f"{what} are given as a list, not as {shown(value)[:60]}")


def require_able(part: object, method: str, what: str) -> None:
    """Raise `InputError` unless `part` is `None` or an object with that method; `what` is its word in the message."""
    if part is None:
        return
    _require_object(part, what)
    if not callable(getattr(part, method, None)):
        raise InputError(f"{what} needs a method '{method}', which {shown(part)[:60]} lacks")


def _require_object(part: object, what: str) -> None:
    if isinstance(part, type):
        raise InputError(f"{what} is an object, not a class; an instance is made by {part.__name__}()")


def require_methods(part: _Part, kind: type[object]) -> _Part:
    """Return a part, e.g. a driver; raise `InputError` if it lacks a method of its protocol `kind`."""
    _require_object(part, f"a {kind.__name__}")
    missing = [name for name in vars(kind) if name[0] != "_" and not callable(getattr(part, name, None))]
    if missing:
        raise InputError(f"{shown(part)[:60]} is no {kind.__name__}: it has no method '{missing[0]}'", found=missing[0])
    return part


def require_condition(text: object) -> None:
    """Raise `InputError` unless `text` is a text or an expression; neither is parsed or checked here."""
    if isinstance(text, Fact):
        raise InputError(f"a condition is text such as '(clean cup1)', not a Fact; write it as text: {text}")
    if not isinstance(text, str | Expression):
        raise InputError(f"a condition is text such as '(clean cup1)', not {shown(text)}")


def require_params(params: object) -> None:
    """Raise an error unless `params` is a mapping to values that may be arguments of facts.

    Raises:
        InputError: `params` is not a mapping, a name is not text, or a value has another type.
        SchemaError: a value is a geometry.
    """
    if type(params) is not dict and not isinstance(params, Mapping):
        raise InputError(f"parameters are a mapping of variables' names to values, not {shown(params)}")
    for name, value in params.items():
        if not isinstance(name, str):
            raise InputError(f"a parameter's name is text, not {shown(name)}")
        if type(value) in VALUE_TYPES or isinstance(value, Value):
            continue
        if isinstance(value, tuple):
            raise SchemaError(f"'?{name}' cannot be a geometry; write it into the condition: (geometry ...)")
        raise InputError(f"'?{name}' is a name, a number or a truth value, not {shown(value)}")


def fitted_names(e: Expression, params: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the parameters as `e` spells them; variables of a text are in lower case.

    Raises:
        UnknownNameError: `e` has no such free variable.
        InputError: two of the names denote the same variable.
    """
    free = free_variables(e)
    found: dict[str, None] = {}
    for name in params:
        own = name if name in free else name.lower()
        if own not in free:
            valid = [f"?{known}" for known in free]
            message = f"the condition has no free variable '?{name}' that could be given a value"
            raise UnknownNameError(message, place=e.place, found=f"?{name}", valid=valid)
        if own in found:
            raise InputError(f"the variable '?{own}' is given two values", place=e.place)
        found[own] = None
    return tuple(found)


def require_text(value: object, what: str) -> None:
    """Raise `InputError` unless `value` is text; `what` is the word for it in the message."""
    if not isinstance(value, str):
        raise InputError(f"{what} is text, not {shown(value)}")


def require_version(version: object) -> None:
    """Raise `InputError` unless `version` is a whole number in the range of versions."""
    if isinstance(version, bool) or not isinstance(version, int) or version.bit_length() > 63:
        raise InputError(f"a version is a whole number, 0 or more, not {shown(version)}")


def require_time(time: object) -> None:
    """Raise `InputError` unless `time` is a finite number."""
    try:
        if isinstance(time, int | float) and not isinstance(time, bool) and math.isfinite(time):
            return
    except OverflowError:
        pass
    raise InputError(f"a time is a finite number of seconds, not {shown(time)}")


def require_delta(delta: object) -> None:
    """Raise `InputError` unless `delta` is a `Delta` whose parts have their declared types."""
    if not isinstance(delta, Delta):
        raise InputError(f"a change is a Delta, not {shown(delta)}")
    if delta == _NO_CHANGE:  # the usual case; an empty part of another type differs
        return
    for name in ("nodes", "values"):
        if not isinstance(part := getattr(delta, name), Mapping):
            raise InputError(f"a Delta's '{name}' is a mapping, not {shown(part)}")
    for name, kind in (("removed", Fact), ("added", Fact), ("replaced", Fact), ("removed_nodes", str)):
        part = getattr(delta, name)
        if not isinstance(part, tuple) or not all(isinstance(one, kind) for one in part):
            said = "facts" if kind is Fact else "names"
            raise InputError(f"a Delta's '{name}' is a tuple of {said}, not {shown(part)}")
    for fluent in delta.values:
        if not isinstance(fluent, Fact):
            example = f"fact({fluent!r})" if isinstance(fluent, str) else "fact('distance', 'a', 'b')"
            raise InputError(f"the keys of a Delta's 'values' are facts such as {example}, not {shown(fluent)}")
    for fact in (*delta.removed, *delta.added, *delta.replaced, *delta.values):
        if not (isinstance(fact.predicate, str) and isinstance(fact.args, tuple)):
            raise InputError(f"a fact is a name with a tuple of arguments, not {shown(fact)}")
