"""Checks of single nodes: number of children, ports, texts of ports, scripts, and the tree of a subtree."""

from __future__ import annotations

import math
from collections.abc import Mapping

from dsc.trees.kinds import BOOLEAN, INTEGER, KINDS, NUMBER, SCRIPT, STATUS, Kind
from dsc.trees.model import Node, Port, TreeFile
from dsc.trees.running.ports import TRUTH, key_of
from dsc.trees.script import parse_script
from knowledge_base.errors import InputError, ParseError, UnknownNameError

_STATUSES = ("SUCCESS", "FAILURE", "RUNNING", "SKIPPED")


def check_node(node: Node, file: TreeFile) -> None:
    """Raise an error if a node violates a rule of its kind.

    Raises:
        UnknownNameError: a port or a tree does not exist.
        ParseError: a script is not valid.
        InputError: the number of children is not that of the kind, or a port is missing or has no valid text.
    """
    for attribute, text in node.scripts.items():
        _check_script(node, attribute, text)
    if node.role == "subtree":
        check_subtree(node, file)
    elif node.kind in KINDS:
        kind = KINDS[node.kind]
        _check_children(node, kind)
        _check_ports(node, kind.ports)
        for name, text in node.ports.items():
            _check_text(node, kind.ports[name], text)
    elif node.kind in file.models:
        _check_ports(node, {port.name: port for port in file.models[node.kind].ports}, whole=False)


def check_subtree(node: Node, file: TreeFile) -> None:
    """Raise an error if a subtree names no tree, has children, or lacks a port that the file declares."""
    if node.tree not in file.trees:
        message = f"{node.element}: the file has no tree '{node.tree}'"
        raise UnknownNameError(message, place=node.place, found=node.tree, valid=file.trees)
    if node.children:
        raise InputError(f"{node.element} has a child, but its content is the tree '{node.tree}'", place=node.place)
    autoremap = node.ports.get("_autoremap", "false")
    if autoremap not in {"true", "false", "1", "0"}:
        message = f"{node.element}: '_autoremap' is true or false, not '{autoremap}'"
        raise InputError(message, place=node.place, found=autoremap, valid=["true", "false"])
    model = file.models.get(node.tree)
    if model is None or autoremap in {"true", "1"}:
        return
    missing = next((port.name for port in model.ports if port.default is None and port.name not in node.ports), None)
    if missing is not None:
        message = f"{node.element} needs the port '{missing}', which TreeNodesModel declares"
        raise InputError(f"{message} at line {model.place.line}", place=node.place)


def _check_children(node: Node, kind: Kind) -> None:
    found = len(node.children)
    if found >= kind.least and (kind.most is None or found <= kind.most):
        return
    if kind.most == kind.least:
        wanted = f"{kind.least or 'no'} {'child' if kind.least == 1 else 'children'}"
    else:
        wanted = f"{kind.least} or more children" if kind.most is None else f"{kind.least} to {kind.most} children"
    raise InputError(f"{node.element} has {wanted}; found {found}", place=node.place)


def _check_ports(node: Node, ports: Mapping[str, Port], *, whole: bool = True) -> None:
    """Compare the ports of a node with the declared ones; without `whole`, a port may be missing."""
    for name in node.ports:
        if name not in ports:
            message = f"{node.element} has no port '{name}'"
            raise UnknownNameError(message, place=node.place, found=name, valid=ports)
    for name, port in ports.items():
        if whole and port.default is None and name not in node.ports and port.type != "text":
            raise InputError(f"{node.element} needs the port '{name}'", place=node.place)
    if whole and node.kind == "SetBlackboard" and "value" not in node.ports:
        raise InputError(f"{node.element} needs the port 'value'", place=node.place)


def _check_text(node: Node, port: Port, text: str) -> None:
    """Compare the text of a port with the port's type."""
    if port.type == SCRIPT:
        _check_script(node, port.name, text)
    elif port.type == STATUS and text not in _STATUSES:
        message = f"{node.element}: the port '{port.name}' is a status, not '{text}'"
        raise UnknownNameError(message, place=node.place, found=text, valid=_STATUSES)
    elif key_of(port.name, text) is not None:
        return
    elif port.type == INTEGER and not _is_integer(text):
        message = f"{node.element}: the port '{port.name}' is an integer or a {{key}}, not '{text}'"
        raise InputError(message, place=node.place, found=text)
    elif port.type == NUMBER and not _is_number(text):
        message = f"{node.element}: the port '{port.name}' is a number or a {{key}}, not '{text}'"
        raise InputError(message, place=node.place, found=text)
    elif port.type == BOOLEAN and text not in TRUTH:
        message = f"{node.element}: the port '{port.name}' is true, false or a {{key}}, not '{text}'"
        raise InputError(message, place=node.place, found=text)


def _is_integer(text: str) -> bool:
    return text.removeprefix("-").isdecimal() and text.isascii()


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _check_script(node: Node, attribute: str, text: str) -> None:
    try:
        parse_script(text)
    except ParseError as error:
        raise ParseError(f"{node.element}: '{attribute}': {error.message}", place=node.place) from None
