"""Elements of a tree as nodes, in the compact form `<Name …/>` and in the explicit form `<Action ID="Name" …/>`."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import cast

from dsc.scxml.document import Element
from dsc.trees.kinds import KINDS, NO_COUNTERPART, SCRIPTS
from dsc.trees.model import Node, NodeModel, Role
from dsc.trees.reading.attributes import require_attribute
from dsc.trees.reading.format_3 import FORMER_KINDS
from knowledge_base.errors import InputError, UnknownNameError, tolerated

EXPLICIT: Mapping[str, Role] = {
    "Action": "action",
    "Condition": "condition",
    "Control": "control",
    "Decorator": "decorator",
    "SubTree": "subtree",
}
"""The role that an element of the explicit form states."""
IGNORED = frozenset({"_description", "_collapsed", "_favorite", "_fullpath", "_uid"})
"""Attributes that only an editor uses."""
_RESERVED = frozenset({"ID", "name", *SCRIPTS, *IGNORED})
Models = Mapping[str, NodeModel]


def read_node(element: Element, models: Models) -> Node:
    """Return the node for an element, with its inner nodes.

    Raises:
        UnknownNameError: the kind of node does not exist.
        InputError: the kind has no counterpart here, or an attribute is missing or not allowed.
    """
    role: Role = "leaf"
    kind = element.name
    with tolerated():  # a check reports all unknown kinds of a file
        kind, role = _kind(element, models)
    attributes = element.attributes
    tree = require_attribute(element, "ID") if role == "subtree" else ""
    ports = {name: text for name, text in attributes.items() if name not in _RESERVED}
    for name in ports:
        _require_port_name(element, name, role)
    return Node(
        kind,
        role,
        attributes.get("name", ""),
        tree,
        MappingProxyType(ports),
        MappingProxyType({name: attributes[name] for name in SCRIPTS if name in attributes}),
        tuple(read_node(child, models) for child in element.children),
        element.place,
    )


def _require_port_name(element: Element, name: str, role: Role) -> None:
    if name.startswith("_") and not (role == "subtree" and name == "_autoremap"):
        valid = [*SCRIPTS, *(["_autoremap"] if role == "subtree" else [])]
        raise UnknownNameError(
            f"<{element.name}> has no attribute '{name}'", place=element.place, found=name, valid=valid
        )


def _kind(element: Element, models: Models) -> tuple[str, Role]:
    """Return the kind and the role of an element."""
    if element.namespace:
        raise InputError(f"<{element.name}> belongs to a namespace; nodes have none", place=element.place)
    stated = EXPLICIT.get(element.name)
    if stated == "subtree":
        return "SubTree", "subtree"
    if stated is None and "ID" in element.attributes:
        message = f"<{element.name}> has no attribute 'ID', which only the explicit form has"
        valid = [] if element.name in KINDS else EXPLICIT
        raise UnknownNameError(message, place=element.place, found=element.name, valid=valid)
    kind = element.name if stated is None else require_attribute(element, "ID")
    if kind in KINDS:
        role = KINDS[kind].role
        if stated not in {None, role}:
            message = f"<{element.name} ID='{kind}'>: '{kind}' is a {role}, not a {stated}"
            raise InputError(message, place=element.place)
        return kind, role
    return kind, _leaf_role(element, kind, stated, models)


def _leaf_role(element: Element, kind: str, stated: Role | None, models: Models) -> Role:
    """Return the role of a kind that is not built in; raise an error unless it is a leaf."""
    if kind in NO_COUNTERPART:
        raise InputError(f"<{kind}> has no counterpart: {NO_COUNTERPART[kind]}", place=element.place, found=kind)
    if kind in FORMER_KINDS:
        message = f"<{kind}> is a name of format 3: in format 4 write {FORMER_KINDS[kind]}"
        raise InputError(message, place=element.place, found=kind)
    model = models.get(kind)
    role = stated or (model.role if model else "leaf")
    if model is not None and stated is not None and model.role != stated:
        message = f"<{element.name} ID='{kind}'>: TreeNodesModel declares '{kind}' as {model.role}"
        raise InputError(f"{message} at line {model.place.line}", place=element.place)
    if role not in {"action", "condition", "leaf"}:
        message = f"<{element.name}> '{kind}' is a {role} of another program: write it with supported nodes"
        raise UnknownNameError(message, place=element.place, found=kind, valid=KINDS)
    if element.children:
        valid = [name for name, one in KINDS.items() if one.role in {"control", "decorator"}]
        message = f"<{kind}> has children, and is neither a supported control nor a supported decorator"
        raise UnknownNameError(message, place=element.place, found=kind, valid=valid)
    return cast("Role", role)
