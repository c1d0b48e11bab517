"""Files of behaviour trees as values: the elements `root`, `BehaviorTree` and `TreeNodesModel` (S4.18).

SCXML has the same reader of XML, on `xml.parsers.expat`: it has lines, and refuses document types and entities.
"""

from __future__ import annotations

from pathlib import Path

from dsc.scxml.document import Element, read_xml
from dsc.text.yaml import read_file
from dsc.trees.model import Node, NodeModel, Tree, TreeFile
from dsc.trees.reading.attributes import require_attribute, require_attributes
from dsc.trees.reading.checks import check_node, check_subtree
from dsc.trees.reading.format_3 import as_format_4
from dsc.trees.reading.models import read_models
from dsc.trees.reading.nodes import read_node
from knowledge_base.errors import InputError, UnknownNameError, shortened, tolerated

MAX_DEPTH = 100
"""Upper bound of the depth of elements."""
_ROOT = frozenset({"BTCPP_format", "main_tree_to_execute", "project_name"})
_PARTS = frozenset({"BehaviorTree", "TreeNodesModel"})
FORMATS = ("3", "4")


def load_trees(path: Path | str) -> TreeFile:
    """Return the trees of a file.

    Raises:
        InputError: as for `parse_trees`, or the file cannot be read.
    """
    return parse_trees(read_file(path), str(path))


def parse_trees(text: str, source: str | None = None) -> TreeFile:
    """Return the trees of an XML text in format 3 or 4; `source` is the file name in messages.

    A file without `BTCPP_format` has format 3; its trees are returned with the names of format 4.

    Raises:
        ParseError: the text is not XML, has a document type, or is too large or deep; or a script is not valid.
        UnknownNameError: an element, attribute, port or tree does not exist; the message has the nearest valid name.
        InputError: the text violates another rule of the format; the message has file, line, element and remedy.
    """
    root = read_xml(text, source, MAX_DEPTH)
    if root.name != "root" or root.namespace:
        raise InputError(f"<root> was expected; found <{root.name}>", place=root.place, found=root.name, valid=["root"])
    require_attributes(root, _ROOT)
    _require_no_text(root)
    written = root.attributes.get("BTCPP_format", "3")
    if written not in FORMATS:
        message = f"<root>: the format '{written}' is unknown"
        raise InputError(message, place=root.place, found=written, valid=FORMATS)
    for part in root.children:
        _require_part(part)
    if written == "3":
        for part in root.children:
            if part.name == "BehaviorTree":
                as_format_4(part)
    return _read(root)


def _require_part(part: Element) -> None:
    if part.name == "include":
        message = "<include> has no counterpart: copy the trees of the other file into this one"
        raise InputError(message, place=part.place, found="include")
    if part.name not in _PARTS or part.namespace:
        message = f"<{part.name}> is not allowed in <root>"
        raise UnknownNameError(message, place=part.place, found=part.name, valid=_PARTS)


def _require_no_text(element: Element) -> None:
    """Refuse a text outside of attributes; a name of a node may only be an attribute."""
    if element.text:
        message = f"<{element.name}> holds the text '{shortened(element.text, 40)}', which belongs into an attribute"
        raise InputError(message, place=element.place)


def _read(root: Element) -> TreeFile:
    models: dict[str, NodeModel] = {}
    for part in root.children:
        if part.name == "TreeNodesModel":
            _add_models(models, part)
    trees: dict[str, Tree] = {}
    parts = [part for part in root.children if part.name == "BehaviorTree"]
    if not parts:
        raise InputError("a file needs at least one <BehaviorTree>", place=root.place)
    for part in parts:
        tree = _read_tree(part, models, alone=len(parts) == 1)
        if tree.name in trees:
            first = trees[tree.name].place.line
            raise InputError(f"<BehaviorTree ID='{tree.name}'> exists already, at line {first}", place=tree.place)
        trees[tree.name] = tree
    main = root.attributes.get("main_tree_to_execute") or (next(iter(trees)) if len(trees) == 1 else None)
    if main is not None and main not in trees:
        message = f"<root>: main_tree_to_execute names no tree of the file, but '{main}'"
        raise UnknownNameError(message, place=root.place, found=main, valid=trees)
    file = TreeFile(trees, main, models)
    _check(file)
    return file


def _add_models(models: dict[str, NodeModel], part: Element) -> None:
    for model in read_models(part):
        if model.kind in models:
            first = models[model.kind].place.line
            raise InputError(f"<TreeNodesModel> declares '{model.kind}' already, at line {first}", place=model.place)
        models[model.kind] = model


def _read_tree(part: Element, models: dict[str, NodeModel], *, alone: bool) -> Tree:
    require_attributes(part, {"ID", "_description", "_fullpath", "_favorite", "editable"})
    name = part.attributes.get("ID", "main") if alone else require_attribute(part, "ID")
    for element in part.walk():
        _require_no_text(element)
    if len(part.children) != 1:
        found = len(part.children)
        raise InputError(f"<BehaviorTree ID='{name}'> needs one child; found {found}", place=part.place)
    return Tree(name, read_node(part.children[0], models), part.place)


def _check(file: TreeFile) -> None:
    for tree in file.trees.values():
        for node in tree.root.walk():
            with tolerated():
                check_node(node, file)
    for name in file.trees:
        _require_no_circle(file, name)


def _require_no_circle(file: TreeFile, name: str) -> None:
    """Refuse a tree that contains itself."""
    waiting: list[tuple[str, Node]] = [(name, node) for node in file.trees[name].root.walk()]
    seen: set[str] = set()
    while waiting:
        _, node = waiting.pop()
        if node.role != "subtree" or node.tree in seen:
            continue
        if node.tree == name:
            raise InputError(f"{node.element}: the tree '{name}' contains itself", place=node.place)
        seen.add(node.tree)
        check_subtree(node, file)
        waiting.extend((node.tree, inner) for inner in file.trees[node.tree].root.walk())
