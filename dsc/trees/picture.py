"""Pictures of trees as text and as plain data."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from dsc.trees.model import Node, Tree


def tree_lines(tree: Tree) -> Iterator[str]:
    """Yield the lines of a tree: each node with its name, ports and scripts, below its parent."""
    yield tree.name
    yield from _lines(tree.root, "", last=True)


def _lines(node: Node, before: str, *, last: bool) -> Iterator[str]:
    yield f"{before}{'└── ' if last else '├── '}{_caption(node)}"
    inner = f"{before}{'    ' if last else '│   '}"
    for at, child in enumerate(node.children, 1):
        yield from _lines(child, inner, last=at == len(node.children))


def _caption(node: Node) -> str:
    kind = f"{node.kind} {node.tree}" if node.tree else node.kind
    name = f" '{node.name}'" if node.name else ""
    texts = "".join(f" {attribute}={text!r}" for attribute, text in {**node.ports, **node.scripts}.items())
    return f"{kind}{name}{texts}"


def tree_data(tree: Tree) -> dict[str, Any]:
    """Return a tree as plain data."""
    return {"tree": tree.name, "line": tree.place.line, "root": _data(tree.root)}


def _data(node: Node) -> dict[str, Any]:
    return {
        "kind": node.kind,
        "role": node.role,
        "name": node.name or None,
        "tree": node.tree or None,
        "ports": dict(node.ports),
        "scripts": dict(node.scripts),
        "line": node.place.line,
        "children": [_data(child) for child in node.children],
    }
