"""Requests of the page: JSON of bounded size and depth with typed fields; others are an `InputError`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from pydantic_core import from_json

from knowledge_base.errors import InputError

MOST_BYTES = 1 << 20
"""Upper bound of a request's body."""
Form = Mapping[str, tuple[Callable[[Any], bool], str]]
"""Optional fields of a request: the test of a value, and the words for its type."""


def asked(body: bytes | str, form: Form = MappingProxyType({})) -> dict[str, Any]:
    """Return the request in a text.

    Raises:
        InputError: it is not a JSON object, is nested too deeply, or a field has a value of another type.
    """
    try:
        request = from_json(body, allow_inf_nan=False)
    except ValueError as error:
        raise InputError(f"a request is one JSON object: {error}") from None
    if not isinstance(request, dict):
        raise InputError("a request is one JSON object")
    for name, (fits, words) in form.items():
        if request.get(name) is not None and not fits(request[name]):
            raise InputError(f"'{name}' is {words}")
    return request


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _number(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _scalar(value: Any) -> bool:
    return isinstance(value, str | int | float | bool)


def _scalars(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_scalar, value.values()))


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_text, value))


def _one_text(value: Any) -> bool:
    return isinstance(value, dict) and len(value) == 1 and all(map(_text, value.values()))


SEQ = (_number, "the number of a record")
QUERY: Form = {"seq": SEQ, "expression": (_text, "a text"), "params": (_scalars, "names with their values")}
FACTS: Form = {"seq": SEQ, "about": (_text, "a text")}
CONTROL: Form = {
    "do": (_text, "a text"),
    "name": (_text, "a text"),
    "attributes": (lambda value: isinstance(value, dict), "names with their values"),
    "statements": (_texts, "a list of texts such as (on cup1 table)"),
    "owner": (_text, "a text"),
    "on": (_one_text, "one of state, event, condition, plan_step, with a text"),
    "number": (_number, "the number of a breakpoint"),
}
