"""Behaviour trees as frozen values: a file with its trees, their nodes, and the declared ports of leaves (S4.18).

The kinds have the names of BehaviorTree.CPP, version 4, in files of format 3, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from knowledge_base.errors import Place

Role = Literal["control", "decorator", "action", "condition", "subtree", "leaf"]
"""The role of a node; `leaf` is an action or a condition, until a binding decides."""
Direction = Literal["input", "output", "inout"]
NO_TEXTS: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Port:
    """A declared port of a kind of node.

    Attributes:
        name: the port's name, an attribute of the node in XML.
        direction: whether the node reads the port, writes it, or both.
        type: the type as written in the file, e.g. `std::string`; empty if the file has none.
        default: the text of the value of a port that a node omits; `None` if the node must have the port.
        description: a text for people.
    """

    name: str
    direction: Direction = "input"
    type: str = ""
    default: str | None = None
    description: str = ""


@dataclass(frozen=True, slots=True)
class NodeModel:
    """The declaration of a kind of node in `TreeNodesModel`.

    Attributes:
        kind: the name of the kind; for a subtree, the name of the tree.
        role: `action`, `condition` or `subtree`.
        ports: the declared ports.
        place: the place in the file.
    """

    kind: str
    role: Role
    ports: tuple[Port, ...] = ()
    place: Place = field(default=Place(), compare=False)

    def port(self, name: str) -> Port | None:
        """Return the port of this name, or `None`."""
        return next((one for one in self.ports if one.name == name), None)


@dataclass(frozen=True, slots=True)
class Node:
    """A node of a tree.

    Attributes:
        kind: the kind of node, e.g. `Sequence`, or the name of a leaf.
        role: see `Role`.
        name: the name of this node; empty if the file has none.
        tree: the tree that a `SubTree` runs; otherwise empty.
        ports: texts by port; for a `SubTree`, the remapped keys and constants, with `_autoremap`.
        scripts: scripts by attribute, e.g. `_successIf`.
        children: the nodes inside this node.
        place: the place in the file.
    """

    kind: str
    role: Role
    name: str = ""
    tree: str = ""
    ports: Mapping[str, str] = field(default_factory=lambda: NO_TEXTS)
    scripts: Mapping[str, str] = field(default_factory=lambda: NO_TEXTS)
    children: tuple[Node, ...] = ()
    place: Place = field(default=Place(), compare=False)

    @property
    def title(self) -> str:
        """The name of the node, else its kind or the name of its tree."""
        return self.name or self.tree or self.kind

    @property
    def element(self) -> str:
        """The node as messages name it, e.g. `<Sequence>`."""
        return f"<{self.kind} ID='{self.tree}'>" if self.tree else f"<{self.kind}>"

    def walk(self) -> Iterator[Node]:
        """Yield the node and all inner nodes, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True, slots=True)
class Tree:
    """A tree of a file: its name and its root node."""

    name: str
    root: Node
    place: Place = field(default=Place(), compare=False)


@dataclass(frozen=True, slots=True)
class TreeFile:
    """The content of a file.

    Attributes:
        trees: the trees by name, in the order of the file.
        main: the name of the tree that runs; `None` if several trees exist and none is named.
        models: the declarations of `TreeNodesModel`, by kind.
    """

    trees: Mapping[str, Tree]
    main: str | None = None
    models: Mapping[str, NodeModel] = field(default_factory=dict)
