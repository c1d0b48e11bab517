"""Decorators without a timer: nodes that change the status of their child, or tick it several times."""

from __future__ import annotations

from dsc.trees.evaluation import evaluate_script, is_true
from dsc.trees.running.node import COMPLETE, Decorator, Status, at_node, reset
from dsc.trees.running.ports import integer_port, text_of_port, truth_port
from dsc.trees.script import parse_script

FOREVER = -1
"""The number of cycles or attempts without end."""


class Changer(Decorator):
    """Base of the decorators that replace the status at the child's end."""

    AT_SUCCESS: Status
    AT_FAILURE: Status

    def tick(self) -> Status:
        """Tick the child, and replace the status at its end."""
        self.status = Status.RUNNING
        status = self.child.execute()
        if status not in COMPLETE:
            return status
        reset(self.child)
        return self.AT_SUCCESS if status is Status.SUCCESS else self.AT_FAILURE


class Inverter(Changer):
    """`Inverter`: success becomes failure, and failure becomes success."""

    AT_SUCCESS, AT_FAILURE = Status.FAILURE, Status.SUCCESS


class ForceSuccess(Changer):
    """`ForceSuccess`: the end of the child is a success."""

    AT_SUCCESS = AT_FAILURE = Status.SUCCESS


class ForceFailure(Changer):
    """`ForceFailure`: the end of the child is a failure."""

    AT_SUCCESS = AT_FAILURE = Status.FAILURE


class KeepRunningUntilFailure(Decorator):
    """`KeepRunningUntilFailure`: ticks the child again after each success."""

    def tick(self) -> Status:
        """Tick the child; end if it fails."""
        self.status = Status.RUNNING
        status = self.child.execute()
        if status in COMPLETE:
            reset(self.child)
        return Status.FAILURE if status is Status.FAILURE else Status.RUNNING


class Loop(Decorator):
    """Base of `Repeat` and `RetryUntilSuccessful`: `AGAIN` begins the next cycle, if any is left."""

    PORT: str
    AGAIN: Status
    ENDS: Status
    RENEWS = False
    """Whether the number of cycles is read again after each cycle."""
    cycles = 0

    def halt(self) -> None:
        """Halt the child; the next tick begins with the first cycle."""
        self.cycles = 0
        super().halt()

    def tick(self) -> Status:
        """Tick the child; the node waits between two cycles of a child that ends in one tick."""
        most = integer_port(self.node, self.PORT, self.board)
        self.status = Status.RUNNING
        while self.cycles < most or most == FOREVER:
            before = self.child.status
            status = self.child.execute()
            if status is Status.RUNNING:
                return status
            if status is self.AGAIN:
                self.cycles += 1
                if self.RENEWS:
                    most = integer_port(self.node, self.PORT, self.board)
                reset(self.child)
                if (self.cycles < most or most == FOREVER) and self.wake(before):
                    return Status.RUNNING
                continue
            if status is self.ENDS:
                self.cycles = 0
            reset(self.child)
            return status
        self.cycles = 0
        return self.AGAIN


class Repeat(Loop):
    """`Repeat`: repeats the child until it fails."""

    PORT, AGAIN, ENDS = "num_cycles", Status.SUCCESS, Status.FAILURE


class RetryUntilSuccessful(Loop):
    """`RetryUntilSuccessful`: repeats the child until it succeeds; a child may change the number of attempts."""

    PORT, AGAIN, ENDS = "num_attempts", Status.FAILURE, Status.SUCCESS
    RENEWS = True


class RunOnce(Decorator):
    """`RunOnce`: after the first end of the child, it is skipped, or returns the same status."""

    end: Status | None = None

    def tick(self) -> Status:
        """Tick the child until its first end."""
        if self.end is not None:
            return Status.SKIPPED if truth_port(self.node, "then_skip", self.board) else self.end
        self.status = Status.RUNNING
        status = self.child.execute()
        if status in COMPLETE:
            self.end = status
            reset(self.child)
        return status


class Precondition(Decorator):
    """`Precondition`: ticks the child if a script is true at its start, else returns the status `else`.

    As in BehaviorTree.CPP, a child that was halted is ticked again without a test.
    """

    ticking = False

    def tick(self) -> Status:
        """Test the script before the child begins, then tick the child."""
        if not self.ticking:
            with at_node(self.node):
                script = parse_script(text_of_port(self.node, "if") or "")
                self.ticking = is_true(evaluate_script(script, self.board, self.run.enums))
        if not self.ticking:
            return Status[text_of_port(self.node, "else") or ""]
        status = self.child.execute()
        if status in COMPLETE:
            reset(self.child)
            self.ticking = False
        return status


class SubTree(Decorator):
    """`SubTree`: the root of another tree, with its own blackboard."""

    def tick(self) -> Status:
        """Tick the root of the tree."""
        if self.status is Status.IDLE:
            self.status = Status.RUNNING
        status = self.child.execute()
        if status in COMPLETE:
            reset(self.child)
        return status
