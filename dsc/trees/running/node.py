"""The base of all running nodes: a status, conditions before a tick and scripts after it, halting."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum

from dsc.trees.blackboard import Board
from dsc.trees.evaluation import Enums, evaluate_script, is_true
from dsc.trees.model import Node
from dsc.trees.script import Script, parse_script
from knowledge_base.errors import InputError


class Status(Enum):
    """The status of a node; only a tick returns `SKIPPED`."""

    IDLE = "idle"
    RUNNING = "running"
    SUCCESS = "success"
    FAILURE = "failure"
    SKIPPED = "skipped"


COMPLETE = frozenset({Status.SUCCESS, Status.FAILURE})


@dataclass(slots=True)
class Run:
    """The clock, constants, timers and wake-ups that the nodes of a running tree share.

    Attributes:
        now: returns the seconds of run time.
        enums: constants of enumerations in scripts.
        woken: whether a node asks for another tick immediately.
        due: the seconds at which timers of nodes end, by timer.
    """

    now: Callable[[], float]
    enums: Enums = field(default_factory=dict)
    woken: bool = False
    due: dict[object, float] = field(default_factory=dict)


@contextmanager
def at_node(node: Node) -> Iterator[None]:
    """Add the place and the element of a node to an error of the block."""
    try:
        yield
    except InputError as error:
        if error.place is None:
            error.message = f"{node.element}: {error.message}"
        raise error.located(node.place) from None


class RunningNode:
    """A node that is ticked, with the semantics of `TreeNode` and `ControlNode` of BehaviorTree.CPP."""

    def __init__(self, node: Node, board: Board, run: Run, children: Sequence[RunningNode] = ()) -> None:
        self.node = node
        self.board = board
        self.run = run
        self.children = children
        self.status = Status.IDLE
        with at_node(node):
            self._scripts: Mapping[str, Script] = {name: parse_script(text) for name, text in node.scripts.items()}

    def execute(self) -> Status:
        """Check the preconditions, tick the node, execute the scripts after its end; return the status."""
        status = self._precondition()
        if status is None:
            status = self.tick()
        if status in COMPLETE:
            self._execute("_onSuccess" if status is Status.SUCCESS else "_onFailure")
            self._execute("_post")
        if status is not Status.SKIPPED:
            self.status = status
        return status

    def tick(self) -> Status:
        """Execute one step of the node."""
        raise NotImplementedError

    def halt(self) -> None:
        """Halt the running children; the node becomes idle."""
        self.reset_children()
        self.status = Status.IDLE

    def halt_node(self) -> None:
        """Halt the node, and execute its script `_onHalted`."""
        self.halt()
        self._execute("_onHalted")

    def reset_children(self) -> None:
        """Halt the running children; all children become idle."""
        for child in self.children:
            reset(child)

    def wake(self, child_before: Status) -> bool:
        """Ask for another tick if the child was idle before its tick; return whether the node waits for it."""
        if child_before is not Status.IDLE:
            return False
        self.run.woken = True
        return True

    def _execute(self, attribute: str) -> object:
        script = self._scripts.get(attribute)
        if script is None:
            return None
        with at_node(self.node):
            return evaluate_script(script, self.board, self.run.enums)

    def _holds(self, attribute: str) -> bool:
        with at_node(self.node):
            return is_true(self._execute(attribute))

    def _precondition(self) -> Status | None:
        """Return the status that a precondition decides, or `None`; a running node only tests `_while`."""
        if self.status is Status.RUNNING:
            if "_while" in self._scripts and not self._holds("_while"):
                self.halt_node()
                return Status.SKIPPED
            return None
        if self.status is not Status.IDLE:
            return None
        for attribute, status in _AT_START:
            if attribute in self._scripts and self._holds(attribute):
                return status
        return Status.SKIPPED if "_while" in self._scripts and not self._holds("_while") else None


_AT_START = (("_failureIf", Status.FAILURE), ("_successIf", Status.SUCCESS), ("_skipIf", Status.SKIPPED))


def reset(child: RunningNode) -> None:
    """Halt a node if it is running; the node becomes idle."""
    if child.status is Status.RUNNING:
        child.halt_node()
    child.status = Status.IDLE


class Decorator(RunningNode):
    """A node with one child, which becomes idle at its end."""

    @property
    def child(self) -> RunningNode:
        """The only child."""
        return self.children[0]

    def execute(self) -> Status:
        """Tick the node; a child that has ended becomes idle."""
        status = super().execute()
        if self.child.status in COMPLETE:
            self.child.status = Status.IDLE
        return status
