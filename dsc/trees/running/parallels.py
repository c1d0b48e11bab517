"""Parallel nodes, which tick all children that have not ended."""

from __future__ import annotations

from collections.abc import Sequence

from dsc.trees.blackboard import Board
from dsc.trees.model import Node
from dsc.trees.running.node import Run, RunningNode, Status
from dsc.trees.running.ports import integer_port
from knowledge_base.errors import InputError


class ParallelBase(RunningNode):
    """The children that have ended, and the number of each end."""

    def __init__(self, node: Node, board: Board, run: Run, children: Sequence[RunningNode] = ()) -> None:
        super().__init__(node, board, run, children)
        self.ended: set[int] = set()
        self.successes = 0
        self.failures = 0

    def halt(self) -> None:
        """Halt the children, and forget their ends."""
        self.forget()
        super().halt()

    def forget(self) -> None:
        """Forget the ends of the children."""
        self.ended.clear()
        self.successes = self.failures = 0

    def threshold(self, port: str) -> int:
        """Return a number of children; negative numbers count from the number of all children, -1 being all.

        Raises:
            InputError: the number exceeds the number of children.
        """
        given, most = integer_port(self.node, port, self.board), len(self.children)
        if given > most:
            raise InputError(
                f"{self.node.element}: '{port}' is {given}, but only {most} children exist", place=self.node.place
            )
        return max(most + given + 1, 0) if given < 0 else given

    def count(self, index: int) -> bool:
        """Tick a child; return whether it was skipped."""
        status = self.children[index].execute()
        if status in {Status.SUCCESS, Status.FAILURE}:
            self.ended.add(index)
            self.successes += status is Status.SUCCESS
            self.failures += status is Status.FAILURE
        return status is Status.SKIPPED


class Parallel(ParallelBase):
    """`Parallel`: ends as soon as enough children have succeeded or failed."""

    def tick(self) -> Status:
        """Tick the children that have not ended."""
        success, failure = self.threshold("success_count"), self.threshold("failure_count")
        skips_count = integer_port(self.node, "success_count", self.board) < 0
        self.status = Status.RUNNING
        skipped = 0
        for index in range(len(self.children)):
            if index not in self.ended:
                skipped += self.count(index)
            if self.successes + (skipped if skips_count else 0) >= success:
                return self._finish(Status.SUCCESS)
            if len(self.children) - self.failures < success or self.failures == failure:
                return self._finish(Status.FAILURE)
        return Status.SKIPPED if skipped == len(self.children) else Status.RUNNING

    def _finish(self, status: Status) -> Status:
        self.forget()
        self.reset_children()
        return status


class ParallelAll(ParallelBase):
    """`ParallelAll`: ends when all children have ended, and fails if enough of them have failed."""

    def tick(self) -> Status:
        """Tick the children that have not ended."""
        failure = self.threshold("max_failures")
        self.status = Status.RUNNING
        skipped = sum(self.count(index) for index in range(len(self.children)) if index not in self.ended)
        if skipped == len(self.children):
            return Status.SKIPPED
        if skipped + len(self.ended) < len(self.children):
            return Status.RUNNING
        status = Status.FAILURE if self.failures >= failure else Status.SUCCESS
        self.reset_children()
        self.forget()
        return status
