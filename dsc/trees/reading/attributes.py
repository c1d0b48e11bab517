"""Checks of the attributes of an element."""

from __future__ import annotations

from collections.abc import Collection

from dsc.scxml.document import Element
from knowledge_base.errors import InputError, UnknownNameError


def require_attributes(element: Element, valid: Collection[str]) -> None:
    """Raise `UnknownNameError` if an element has another attribute."""
    for name in element.attributes:
        if name not in valid:
            message = f"<{element.name}> has no attribute '{name}'"
            raise UnknownNameError(message, place=element.place, found=name, valid=valid)


def require_attribute(element: Element, name: str) -> str:
    """Return the text of an attribute; raise `InputError` if it is missing or empty."""
    text = element.attributes.get(name, "").strip()
    if not text:
        raise InputError(f"<{element.name}> needs the attribute '{name}'", place=element.place)
    return text
