"""The values of the ports of a running node: a text of the file, or an entry of the blackboard."""

from __future__ import annotations

from dsc.trees.blackboard import EMPTY, Board
from dsc.trees.kinds import KINDS
from dsc.trees.model import Node
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.user_objects import shown


def key_of(port: str, text: str) -> str | None:
    """Return the key that a port's text names, as in `{key}`; `{=}` names the port itself; `None` for a constant."""
    inner = text.strip(" ")
    if len(inner) < 3 or inner[0] != "{" or inner[-1] != "}":
        return None
    return port if inner == "{=}" else inner[1:-1]


def text_of_port(node: Node, port: str) -> str | None:
    """Return the text of a port of a supported kind, or its default."""
    return node.ports.get(port, KINDS[node.kind].ports[port].default)


def read_port(node: Node, port: str, text: str, board: Board) -> object:
    """Return the value of a port.

    Raises:
        InputError: the entry of the blackboard does not exist, or has no value yet.
    """
    key = key_of(port, text)
    if key is None:
        return text
    entry = board.entry(key)
    if entry is None or entry.value is EMPTY:
        message = f"{node.element}: the port '{port}' reads the entry '{key}' of the blackboard, which has no value yet"
        valid = [other for other, one in board.entries.items() if one.value is not EMPTY]
        raise UnknownNameError(message, place=node.place, found=key, valid=valid)
    return entry.value


def integer_port(node: Node, port: str, board: Board) -> int:
    """Return the integer of a port of a supported kind.

    Raises:
        InputError: the port is missing, or has no integer.
    """
    value = _value(node, port, board)
    number = _number(value)
    if number is None or not number.is_integer():
        raise _of_another_type(node, port, value, "an integer")
    return int(number)


def number_port(node: Node, port: str, board: Board) -> float:
    """Return the number of a port of a supported kind.

    Raises:
        InputError: the port is missing, or has no number.
    """
    value = _value(node, port, board)
    number = _number(value)
    if number is None:
        raise _of_another_type(node, port, value, "a number")
    return number


def truth_port(node: Node, port: str, board: Board) -> bool:
    """Return the truth value of a port of a supported kind.

    Raises:
        InputError: the port is missing, or has no truth value.
    """
    value = _value(node, port, board)
    truth = boolean_of(value)
    if truth is None:
        raise _of_another_type(node, port, value, "true or false")
    return truth


def _value(node: Node, port: str, board: Board) -> object:
    text = text_of_port(node, port)
    if text is None:
        raise InputError(f"{node.element} needs the port '{port}'", place=node.place)
    return read_port(node, port, text, board)


def _of_another_type(node: Node, port: str, value: object, wanted: str) -> InputError:
    return InputError(f"{node.element}: the port '{port}' is {wanted}, not {shown(value)}", place=node.place)


def _number(value: object) -> float | None:
    try:
        return float(value) if isinstance(value, int | float | str) else None
    except ValueError:
        return None


TRUTH = {"0": False, "1": True} | {
    text: truth for word, truth in (("true", True), ("false", False)) for text in (word, word.upper(), word.title())
}
"""The texts of truth values in ports."""


def boolean_of(value: object) -> bool | None:
    """Return a value of a port as a truth value, or `None` if it is none."""
    if isinstance(value, str):
        return TRUTH.get(value)
    return bool(value) if isinstance(value, int | float) else None
