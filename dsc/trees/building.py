"""The running nodes of a tree, with one blackboard for each subtree."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping

from dsc.trees.blackboard import Board
from dsc.trees.kinds import INTEGER, KEY, KINDS, SCRIPT, STATUS
from dsc.trees.model import Node, TreeFile
from dsc.trees.running import branches, decorators, leaves, navigation, parallels, sequences, timers
from dsc.trees.running.node import Run, RunningNode
from dsc.trees.running.ports import key_of
from knowledge_base.errors import InputError

MakeLeaf = Callable[[Node, Board, Run], RunningNode]
"""Function that makes the running node of a leaf that is not built in."""
MAX_LEVELS = 150
"""Upper bound of nested nodes, those of subtrees included."""
MAX_NODES = 10_000
"""Upper bound of the nodes of a running tree; each use of a subtree counts."""
_CLASSES: Mapping[str, type[RunningNode]] = {
    "Sequence": sequences.SequenceNode,
    "AsyncSequence": sequences.AsyncSequence,
    "SequenceWithMemory": sequences.SequenceWithMemory,
    "ReactiveSequence": sequences.ReactiveSequence,
    "Fallback": sequences.FallbackNode,
    "AsyncFallback": sequences.AsyncFallback,
    "ReactiveFallback": sequences.ReactiveFallback,
    "Parallel": parallels.Parallel,
    "ParallelAll": parallels.ParallelAll,
    "IfThenElse": branches.IfThenElse,
    "WhileDoElse": branches.WhileDoElse,
    **{f"Switch{cases}": branches.Switch for cases in range(2, 7)},
    "Inverter": decorators.Inverter,
    "ForceSuccess": decorators.ForceSuccess,
    "ForceFailure": decorators.ForceFailure,
    "KeepRunningUntilFailure": decorators.KeepRunningUntilFailure,
    "Repeat": decorators.Repeat,
    "RetryUntilSuccessful": decorators.RetryUntilSuccessful,
    "RunOnce": decorators.RunOnce,
    "Precondition": decorators.Precondition,
    "Delay": timers.Delay,
    "Timeout": timers.Timeout,
    "Sleep": timers.Sleep,
    "RecoveryNode": navigation.RecoveryNode,
    "PipelineSequence": navigation.PipelineSequence,
    "RoundRobin": navigation.RoundRobin,
    "RateController": navigation.RateController,
    "AlwaysSuccess": leaves.Constant,
    "AlwaysFailure": leaves.Constant,
    "Script": leaves.ScriptNode,
    "ScriptCondition": leaves.ScriptNode,
    "SetBlackboard": leaves.SetBlackboard,
    "UnsetBlackboard": leaves.UnsetBlackboard,
}


def build_tree(file: TreeFile, name: str, run: Run, make_leaf: MakeLeaf, board: Board | None = None) -> RunningNode:
    """Return the running root of a tree.

    Args:
        file: the file with the tree and its subtrees.
        name: the name of the tree.
        run: the clock and timers that the nodes share.
        make_leaf: makes the leaves that are not built in.
        board: the blackboard of the tree; a new one by default.

    Raises:
        InputError: the nodes are nested too deep, or too many.
    """
    builder = _Builder(file, run, make_leaf)
    return builder.node(file.trees[name].root, board or Board(), 1)


class _Builder:
    def __init__(self, file: TreeFile, run: Run, make_leaf: MakeLeaf) -> None:
        self._file = file
        self._run = run
        self._make_leaf = make_leaf
        self._nodes = 0

    def node(self, node: Node, board: Board, level: int) -> RunningNode:
        if level > MAX_LEVELS:
            raise InputError(f"{node.element} is nested deeper than {MAX_LEVELS} levels", place=node.place)
        self._nodes += 1
        if self._nodes > MAX_NODES:
            raise InputError(f"{node.element}: the tree has more than {MAX_NODES} nodes", place=node.place)
        if node.role == "subtree":
            root = self._file.trees[node.tree].root
            child = self.node(root, self._inner_board(node, board), level + 1)
            return decorators.SubTree(node, board, self._run, [child])
        if node.kind not in KINDS:
            _create_entries(node, node.ports, board)
            return self._make_leaf(node, board, self._run)
        ports = KINDS[node.kind].ports
        _create_entries(node, [name for name, port in ports.items() if port.type not in {SCRIPT, STATUS, KEY}], board)
        children = [self.node(child, board, level + 1) for child in node.children]
        return _CLASSES[node.kind](node, board, self._run, children)

    def _inner_board(self, node: Node, outer: Board) -> Board:
        """Return the board of a subtree, with the keys that it shares with the outer board, and its constants."""
        model = self._file.models.get(node.tree)
        autoremap = node.ports.get("_autoremap") in {"true", "1"}
        declared = {} if model is None or autoremap else {port.name: port.default for port in model.ports}
        texts = {name: text for name, text in declared.items() if text is not None} | dict(node.ports)
        texts.pop("_autoremap", None)
        keys = {name: key_of(name, text) for name, text in texts.items()}
        board = Board(outer, {name: key for name, key in keys.items() if key is not None}, autoremap=autoremap)
        for name, text in texts.items():
            if keys[name] is None:
                board.own(name, constant_of(text))
        return board


_INTEGER = re.compile(r"-?\d+")
_NUMBER = re.compile(r"-?\d+(\.\d*)?([eE][+-]?\d+)?")


def constant_of(text: str) -> int | float | str:
    """Return a constant of a `SubTree`: an integer, a number, or the text."""
    if _INTEGER.fullmatch(text):
        return int(text)
    return float(text) if _NUMBER.fullmatch(text) else text


def _create_entries(node: Node, ports: Iterable[str], board: Board) -> None:
    """Create the entries that ports of the node name, still without values."""
    known = KINDS[node.kind].ports if node.kind in KINDS else {}
    for port in ports:
        key = key_of(port, node.ports.get(port, ""))
        if key is not None and board.entry(key) is None:
            board.create(key).integer = port in known and known[port].type == INTEGER
