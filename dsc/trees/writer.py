"""Writer of trees as XML in format 4, as Groot reads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from xml.sax.saxutils import escape, quoteattr

from dsc.trees.kinds import KINDS
from dsc.trees.model import Node, NodeModel, Port, TreeFile

_TAGS = {
    "action": "Action",
    "condition": "Condition",
    "control": "Control",
    "decorator": "Decorator",
    "subtree": "SubTree",
}
_INDENT = "  "


def trees_to_xml(file: TreeFile) -> str:
    """Return a file as XML in format 4; reading the text returns an equal value.

    A leaf has the explicit form `<Action ID="Grasp"/>` if its role is known without `TreeNodesModel`.
    """
    root = {"BTCPP_format": "4"} | ({"main_tree_to_execute": file.main} if file.main is not None else {})
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', f"<root{_attributes(root)}>"]
    for tree in file.trees.values():
        lines.append(f"{_INDENT}<BehaviorTree{_attributes({'ID': tree.name})}>")
        lines.extend(_node_lines(tree.root, file, 2))
        lines.append(f"{_INDENT}</BehaviorTree>")
    if file.models:
        lines.append(f"{_INDENT}<TreeNodesModel>")
        for model in file.models.values():
            lines.extend(_model_lines(model))
        lines.append(f"{_INDENT}</TreeNodesModel>")
    return "\n".join([*lines, "</root>", ""])


def _attributes(texts: Mapping[str, str]) -> str:
    return "".join(f" {name}={quoteattr(text, _ESCAPES)}" for name, text in texts.items())


_ESCAPES = {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}


def _node_lines(node: Node, file: TreeFile, level: int) -> Iterator[str]:
    name = {"name": node.name} if node.name else {}
    texts = {**name, **node.ports, **node.scripts}
    tag = node.kind
    if node.role == "subtree":
        texts = {"ID": node.tree, **texts}
    elif node.role in {"action", "condition"} and node.kind not in KINDS and node.kind not in file.models:
        tag, texts = _TAGS[node.role], {"ID": node.kind, **texts}
    start = f"{_INDENT * level}<{tag}{_attributes(texts)}"
    if not node.children:
        yield f"{start}/>"
        return
    yield f"{start}>"
    for child in node.children:
        yield from _node_lines(child, file, level + 1)
    yield f"{_INDENT * level}</{tag}>"


def _model_lines(model: NodeModel) -> Iterator[str]:
    start = f"{_INDENT * 2}<{_TAGS[model.role]}{_attributes({'ID': model.kind})}"
    if not model.ports:
        yield f"{start}/>"
        return
    yield f"{start}>"
    for port in model.ports:
        yield _port_line(port)
    yield f"{_INDENT * 2}</{_TAGS[model.role]}>"


def _port_line(port: Port) -> str:
    texts = {"name": port.name} | ({"type": port.type} if port.type else {})
    texts |= {"default": port.default} if port.default is not None else {}
    tag = f"{port.direction}_port"
    start = f"{_INDENT * 3}<{tag}{_attributes(texts)}"
    return f"{start}>{escape(port.description)}</{tag}>" if port.description else f"{start}/>"
