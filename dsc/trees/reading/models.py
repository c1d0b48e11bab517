"""The element `TreeNodesModel`: declared kinds of nodes with their ports, as Groot writes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dsc.scxml.document import Element
from dsc.trees.kinds import KINDS
from dsc.trees.model import Direction, NodeModel, Port
from dsc.trees.reading.attributes import require_attribute, require_attributes
from dsc.trees.reading.nodes import EXPLICIT
from knowledge_base.errors import InputError, UnknownNameError

_DIRECTIONS: Mapping[str, Direction] = {"input_port": "input", "output_port": "output", "inout_port": "inout"}
_PORT = frozenset({"name", "type", "default", "description"})
_EDITOR = frozenset({"MetadataFields", "description"})
"""Elements of an editor without effect."""


def read_models(element: Element) -> Iterator[NodeModel]:
    """Yield the declarations, without those of supported kinds, which the program knows.

    Raises:
        UnknownNameError: an element or attribute is unknown.
        InputError: a name is missing, or a port is declared twice.
    """
    require_attributes(element, ())
    for declared in element.children:
        if declared.name not in EXPLICIT:
            message = f"<{declared.name}> is not allowed in <TreeNodesModel>"
            raise UnknownNameError(message, place=declared.place, found=declared.name, valid=EXPLICIT)
        require_attributes(declared, {"ID", "editable", "_description"})
        kind = require_attribute(declared, "ID")
        ports = tuple(_read_ports(declared))
        if kind not in KINDS:
            yield NodeModel(kind, EXPLICIT[declared.name], ports, declared.place)


def _read_ports(declared: Element) -> Iterator[Port]:
    names: set[str] = set()
    for child in declared.children:
        if child.name in _EDITOR:
            continue
        if child.name not in _DIRECTIONS:
            message = f"<{child.name}> is not allowed in <{declared.name}> of <TreeNodesModel>"
            raise UnknownNameError(message, place=child.place, found=child.name, valid=_DIRECTIONS)
        require_attributes(child, _PORT)
        name = require_attribute(child, "name")
        if name in names:
            raise InputError(f"<{child.name}>: the port '{name}' is declared twice", place=child.place, found=name)
        names.add(name)
        text = child.attributes.get("description", "") or child.text
        default = child.attributes.get("default") or None
        yield Port(name, _DIRECTIONS[child.name], child.attributes.get("type", ""), default, " ".join(text.split()))
