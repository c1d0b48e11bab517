"""Leaves: the built-in ones, and those that a binding provides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from dsc.trees.blackboard import EMPTY, Board
from dsc.trees.evaluation import evaluate_script, fit_value, is_true, text_of_value
from dsc.trees.model import Node
from dsc.trees.running.node import Run, RunningNode, Status, at_node
from dsc.trees.running.ports import key_of, read_port
from dsc.trees.script import parse_script


class Constant(RunningNode):
    """`AlwaysSuccess` and `AlwaysFailure`."""

    def tick(self) -> Status:
        """Return the status of the kind."""
        return Status.SUCCESS if self.node.kind == "AlwaysSuccess" else Status.FAILURE


class ScriptNode(RunningNode):
    """`Script` and `ScriptCondition`: execute a script; a condition succeeds if it is true."""

    def __init__(self, node: Node, board: Board, run: Run, children: Sequence[RunningNode] = ()) -> None:
        super().__init__(node, board, run, children)
        with at_node(node):
            self._code = parse_script(node.ports.get("code", ""))

    def tick(self) -> Status:
        """Execute the script."""
        with at_node(self.node):
            value = evaluate_script(self._code, self.board, self.run.enums)
            true = self.node.kind == "Script" or is_true(value)
        return Status.SUCCESS if true else Status.FAILURE


class SetBlackboard(RunningNode):
    """`SetBlackboard`: writes a text or the value of another entry."""

    def tick(self) -> Status:
        """Write the entry; fail if the other entry has no value yet."""
        key = _key(self.node, "output_key", self.board)
        text = self.node.ports["value"]
        source = key_of("value", text)
        entry = None if source is None else self.board.entry(source)
        if entry is not None and entry.value is EMPTY:
            return Status.FAILURE
        value = read_port(self.node, "value", text, self.board)
        target = self.board.create(key)
        with at_node(self.node):
            target.value = fit_value(key, target, value, self.run.enums) if target.integer else value
        return Status.SUCCESS


class UnsetBlackboard(RunningNode):
    """`UnsetBlackboard`: removes an entry of this tree's blackboard."""

    def tick(self) -> Status:
        """Remove the entry."""
        self.board.remove(_key(self.node, "key", self.board))
        return Status.SUCCESS


def _key(node: Node, port: str, board: Board) -> str:
    """Return the key that a port contains as text, or in an entry of the blackboard."""
    return text_of_value(read_port(node, port, node.ports[port], board))


class Body(Protocol):
    """The action or condition that a leaf executes."""

    def start(self) -> Status:
        """Begin; a condition returns its result."""
        ...

    def resume(self) -> Status:
        """Return the status of an action that has begun."""
        ...

    def stop(self) -> None:
        """Cancel a running action."""
        ...


class ActionLeaf(RunningNode):
    """An action: it begins once, and keeps its status until its parent resets it."""

    def __init__(self, node: Node, board: Board, run: Run, body: Body) -> None:
        super().__init__(node, board, run)
        self.body = body

    def tick(self) -> Status:
        """Begin the action, or continue it."""
        if self.status is Status.IDLE:
            return self.body.start()
        return self.body.resume() if self.status is Status.RUNNING else self.status

    def halt(self) -> None:
        """Cancel the action."""
        if self.status is Status.RUNNING:
            self.body.stop()
        super().halt()


class ConditionLeaf(ActionLeaf):
    """A condition: each tick tests it."""

    def tick(self) -> Status:
        """Test the condition."""
        return self.body.start()
