"""Leaves of a tree bound to functions of a program, checked before the first tick (S4.7, S4.18)."""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, get_origin, get_type_hints

from pydantic import PydanticUserError, TypeAdapter, ValidationError

from dsc.outcomes import Outcome
from dsc.trees.evaluation import Enums, text_of_value
from dsc.trees.kinds import KINDS
from dsc.trees.main_tree import main_tree
from dsc.trees.model import Node, Port, TreeFile
from dsc.trees.running.ports import key_of
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.user_objects import shown

_WITHOUT_NAME = frozenset({
    inspect.Parameter.VAR_POSITIONAL,
    inspect.Parameter.VAR_KEYWORD,
    inspect.Parameter.POSITIONAL_ONLY,
})  # fmt: skip
"""Kinds of parameters that cannot be passed by name."""
_NO_ENTRIES: Mapping[str, Any] = {}


class Leaf:
    """A function for a leaf: an `Action` or a `Condition`."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Action(Leaf):
    """A leaf that runs a coroutine, e.g. another skill.

    Attributes:
        begin: receives the input ports by name, converted by its annotations, and returns a coroutine.
        ends: the outcome events after which the leaf succeeds; after all others it fails.
        outputs: the output ports that `TreeNodesModel` does not declare; each is an attribute of the outcome.
    """

    begin: Callable[..., Awaitable[Outcome]]
    ends: Collection[str]
    outputs: Collection[str] = ()


@dataclass(frozen=True, slots=True)
class Condition(Leaf):
    """A leaf that succeeds if `holds` is true at the tick; it receives the input ports by name."""

    holds: Callable[..., bool]


@dataclass(frozen=True, slots=True)
class BoundLeaf:
    """A leaf of the file with its function.

    Attributes:
        leaf: the action or condition.
        inputs: the texts of the input ports by name, defaults included.
        outputs: the texts of the output ports by name.
        converters: functions that convert the value of an input port.
    """

    leaf: Leaf
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    converters: Mapping[str, Callable[[object], object]]


@dataclass(frozen=True, slots=True)
class BoundTree:
    """A tree that can run: each leaf has a function.

    Attributes:
        file: the file with the tree.
        name: the name of the tree.
        leaves: the functions by kind of leaf.
        entries: values of the blackboard before the first tick.
        enums: constants in scripts.
    """

    file: TreeFile
    name: str
    leaves: Mapping[str, Leaf]
    entries: Mapping[str, Any] = field(default_factory=dict)
    enums: Enums = field(default_factory=dict)


def bind_tree(
    file: TreeFile,
    leaves: Mapping[str, Leaf],
    *,
    tree: str | None = None,
    entries: Mapping[str, Any] = _NO_ENTRIES,
    enums: Enums = _NO_ENTRIES,
) -> BoundTree:
    """Return a tree with functions for its leaves.

    Args:
        file: the file with the tree and its subtrees.
        leaves: an `Action` or a `Condition` for each kind of leaf.
        tree: the name of the tree; by default the main tree of the file.
        entries: values of the blackboard before the first tick, e.g. arguments of the skill.
        enums: constants that scripts and `Switch` may name.

    Raises:
        UnknownNameError: a leaf has no function, or a function has no leaf; a port is not a parameter.
        InputError: a port without default is missing, or a text of a port cannot be converted.
    """
    bound = BoundTree(file, main_tree(file, tree), dict(leaves), dict(entries), dict(enums))
    used: set[str] = set()
    for node in _leaves(file, bound.name):
        used.add(node.kind)
        if node.kind not in leaves:
            message = f"{node.element} is a leaf without a function"
            raise UnknownNameError(message, place=node.place, found=node.kind, valid=[*leaves, *KINDS])
        bind_leaf(bound, node)
    unused = next((kind for kind in leaves if kind not in used), None)
    if unused is not None:
        place = file.trees[bound.name].place
        message = f"the tree '{bound.name}' has no leaf '{unused}'"
        raise UnknownNameError(message, place=place, found=unused, valid=used)
    return bound


def _leaves(file: TreeFile, name: str) -> Iterator[Node]:
    """Yield the leaves of a tree and its subtrees."""
    waiting, seen = [name], {name}
    while waiting:
        for node in file.trees[waiting.pop()].root.walk():
            if node.kind not in KINDS:
                yield node
            elif node.role == "subtree" and node.tree not in seen:
                seen.add(node.tree)
                waiting.append(node.tree)


def bind_leaf(bound: BoundTree, node: Node) -> BoundLeaf:
    """Return the function of a leaf with the leaf's ports.

    Raises:
        InputError: as for `bind_tree`.
    """
    leaf = bound.leaves[node.kind]
    _require_role(node, leaf)
    model = bound.file.models.get(node.kind)
    declared = {port.name: port for port in model.ports} if model else {}
    function = function_of(leaf)
    parameters = {
        name: one for name, one in inspect.signature(function).parameters.items() if one.kind not in _WITHOUT_NAME
    }
    outputs = {name for name, port in declared.items() if port.direction != "input"}
    outputs |= set(leaf.outputs) if isinstance(leaf, Action) else set()
    defaults = {name: port.default for name, port in declared.items() if port.default is not None}
    texts = defaults | dict(node.ports)
    for name in node.ports:
        if name not in parameters and name not in outputs:
            message = f"{node.element}: its function has no parameter '{name}'"
            raise UnknownNameError(message, place=node.place, found=name, valid=[*parameters, *outputs])
    inputs = {name: text for name, text in texts.items() if name in parameters and _is_input(declared.get(name))}
    _require_whole(node, parameters, inputs)
    converters = _converters(function, inputs)
    for name, text in inputs.items():
        if key_of(name, text) is None:
            convert_port(node, name, text, converters)
    written = {name: texts[name] for name in outputs if name in texts}
    for name, text in written.items():
        if key_of(name, text) is None:
            message = f"{node.element}: the output port '{name}' names an entry, as in {{key}}, not '{text}'"
            raise InputError(message, place=node.place, found=text)
    return BoundLeaf(leaf, inputs, written, converters)


def function_of(leaf: Leaf) -> Callable[..., Any]:
    """Return the function that receives the input ports."""
    function: Callable[..., Any] = getattr(leaf, "begin" if isinstance(leaf, Action) else "holds")
    return function


def _is_input(port: Port | None) -> bool:
    return port is None or port.direction != "output"


def _require_role(node: Node, leaf: Leaf) -> None:
    if not isinstance(leaf, Action | Condition):
        message = f"{node.element} needs Action(…) or Condition(…), not {shown(leaf)}"
        raise InputError(message, place=node.place)
    role = "action" if isinstance(leaf, Action) else "condition"
    if node.role not in {"leaf", role}:
        raise InputError(f"{node.element} is {node.role} in the file, and {role} in the program", place=node.place)


def _require_whole(node: Node, parameters: Mapping[str, inspect.Parameter], inputs: Mapping[str, str]) -> None:
    """Raise an error if a parameter without default has no port."""
    for name, parameter in parameters.items():
        if parameter.default is parameter.empty and name not in inputs:
            message = f"{node.element} needs the port '{name}', a parameter of its function"
            raise InputError(message, place=node.place)


def _converters(function: Callable[..., Any], inputs: Mapping[str, str]) -> dict[str, Callable[[object], object]]:
    try:
        hints = get_type_hints(function)
    except (NameError, TypeError):
        hints = {}
    adapters = {name: _adapter(hints[name]) for name in inputs if name in hints}
    return {name: partial(_convert, hints[name], one) for name, one in adapters.items() if one is not None}


def _adapter(annotation: Any) -> TypeAdapter[Any] | None:
    """Return the conversion for an annotation; `None` for a class without one, whose values are passed unchanged."""
    try:
        return TypeAdapter(annotation)
    except PydanticUserError:
        return None


def _convert(annotation: Any, adapter: TypeAdapter[Any], value: object) -> object:
    if get_origin(annotation) in {list, tuple} and isinstance(value, str):
        value = value.split(";")
    elif annotation is str and isinstance(value, int | float):
        value = text_of_value(value)
    return adapter.validate_python(value)


def convert_port(node: Node, name: str, value: object, converters: Mapping[str, Callable[[object], object]]) -> object:
    """Return a value of a port, converted by the annotation of its parameter.

    Raises:
        InputError: the value cannot be converted.
    """
    if name not in converters:
        return value
    try:
        return converters[name](value)
    except ValidationError as error:
        reason = error.errors()[0]["msg"]
        message = f"{node.element}: the port '{name}' has {shown(value)}: {reason}"
        raise InputError(message, place=node.place) from None
