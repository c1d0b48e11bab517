"""Supported elements and attributes of SCXML, and the refusal of all others."""

from __future__ import annotations

from collections.abc import Mapping

from dsc.errors import NotExpressibleError
from dsc.scxml.document import Element
from knowledge_base.errors import InputError, UnknownNameError, shortened

ATTRIBUTES: Mapping[str, frozenset[str]] = {
    name: frozenset(words.split())
    for name, words in {
        "scxml": "initial name version datamodel binding exmode",
        "state": "id initial",
        "parallel": "id",
        "initial": "",
        "final": "id",
        "history": "id type",
        "transition": "event cond target type",
        "onentry": "",
        "onexit": "",
        "datamodel": "",
        "data": "id expr",
        "raise": "event",
        "assign": "location expr",
        "send": "event eventexpr target type id idlocation delay delayexpr namelist",
        "cancel": "sendid sendidexpr",
        "param": "name expr location",
        "content": "expr",
        "log": "label expr",
        "if": "cond",
        "elseif": "cond",
        "else": "",
    }.items()
}
"""Supported elements -> their attributes."""
STATES = frozenset({"state", "parallel", "final"})

_CHART = frozenset({"transition", "onentry", "onexit", "datamodel", "history"})
_ACTIONS = frozenset({"raise", "assign", "send", "cancel", "log", "if"})
CHILDREN: Mapping[str, frozenset[str]] = {
    "scxml": STATES | {"datamodel"},
    "state": STATES | _CHART | {"initial"},
    "parallel": frozenset({"state", "parallel"}) | _CHART,
    "initial": frozenset({"transition"}),
    "final": frozenset({"onentry"}),
    "history": frozenset({"transition"}),
    "transition": _ACTIONS,
    "onentry": _ACTIONS,
    "onexit": _ACTIONS,
    "datamodel": frozenset({"data"}),
    "send": frozenset({"param", "content"}),
    "if": _ACTIONS | {"elseif", "else"},
}
"""Elements -> the elements allowed directly inside them."""
_MEANINGLESS_IF_EMPTY = frozenset({"id", "target", "initial", "event", "location", "idlocation", "sendid"})
_HOLDS_TEXT = frozenset({"data", "assign", "content"})
_KNOWN_TO_SCXML = frozenset({"script", "foreach", "invoke", "finalize", "donedata", "onexit"})
_KNOWN_ATTRIBUTES = frozenset({"src", "targetexpr", "typeexpr", "srcexpr", "autoforward"})


def check(element: Element) -> None:
    """Refuse elements and attributes, here and inside, that are unknown, misplaced or without counterpart.

    Raises:
        NotExpressibleError: an element or attribute of SCXML has no counterpart in action plots.
        UnknownNameError: it is not an element or attribute of SCXML, or not in this place.
        InputError: an attribute is empty, or text is misplaced.
    """
    known = ATTRIBUTES[element.name]
    for name in element.attributes:
        if name in _KNOWN_ATTRIBUTES:
            raise NotExpressibleError(f"{element.name}/@{name}", "has no counterpart", place=element.place)
        if name not in known:
            raise UnknownNameError(
                f"<{element.name}> has no attribute '{name}'", place=element.place, found=name, valid=known
            )
        if name in _MEANINGLESS_IF_EMPTY and not element.attributes[name].strip():
            raise InputError(f"the attribute '{name}' of <{element.name}> is empty", place=element.place)
    if element.text and element.name not in _HOLDS_TEXT:
        message = f"<{element.name}> holds the text '{shortened(element.text, 40)}', which belongs nowhere"
        raise InputError(message, place=element.place)
    valid = CHILDREN.get(element.name, frozenset())
    for child in element.children:
        if child.foreign or (child.name in _KNOWN_TO_SCXML and child.name not in valid):
            raise NotExpressibleError(child.name, "has no counterpart", place=child.place)
        if child.name not in valid:
            raise UnknownNameError(
                f"<{child.name}> is not allowed in <{element.name}>", place=child.place, found=child.name, valid=valid
            )
        check(child)
