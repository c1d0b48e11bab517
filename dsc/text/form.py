"""Reading of written documents as model values; errors name the line and the nearest key."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from dsc.model.reading import in_yaml, misread
from dsc.text.yaml import Document
from knowledge_base.errors import InputError

_Model = TypeVar("_Model", bound=BaseModel)


def read_model(model: type[_Model], document: Document) -> _Model:
    """Return the document as a value of `model`.

    Raises:
        InputError: the document does not match; the message has file, line, and the nearest valid key.
    """
    if not isinstance(document.data, Mapping):
        found = in_yaml(document.data)
        raise InputError(f"a mapping of keys was expected; found {found}", place=document.place(()))
    try:
        read: _Model = _adapter(model).validate_python(document.data)
    except ValidationError as error:
        wrong, path = misread(error, model, document.data)
        wrong.place = document.place(path)
        raise wrong from None
    return read


@cache
def _adapter(model: type[_Model]) -> TypeAdapter[_Model]:
    return TypeAdapter(model)
