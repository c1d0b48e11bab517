"""Controls and decorators of Nav2 that need no ROS, by the rules of its documentation (S4.18)."""

from __future__ import annotations

import math

from dsc.trees.running.node import Decorator, RunningNode, Status, reset
from dsc.trees.running.ports import integer_port, number_port, truth_port
from knowledge_base.errors import InputError
from knowledge_base.user_objects import shown


class RecoveryNode(RunningNode):
    """`RecoveryNode`: after a failure of the first child, the second one repairs, and the first one is tried again."""

    repairs = False
    retries = 0

    def halt(self) -> None:
        """Halt the children; the next tick begins with the first child and no retry."""
        self.repairs, self.retries = False, 0
        super().halt()

    def tick(self) -> Status:
        """Tick the first child, or the second one after a failure, until one is running or ends the node."""
        most = integer_port(self.node, "number_of_retries", self.board)
        self.status = Status.RUNNING
        while True:
            child = self.children[self.repairs]
            status = child.execute()
            if status is Status.RUNNING:
                return status
            reset(child)
            if self.repairs and status is Status.SUCCESS:
                self.retries += 1
            elif self.repairs or status is not Status.FAILURE or self.retries >= most:
                return self._end(status)
            self.repairs = not self.repairs

    def _end(self, status: Status) -> Status:
        """Return the status at the end: without a repair, the node fails."""
        failed = self.repairs and status is Status.SKIPPED
        self.halt()
        return Status.FAILURE if failed else status


class PipelineSequence(RunningNode):
    """`PipelineSequence`: ticks earlier children again, and passes one that is running if a later one had begun."""

    farthest = 0

    def halt(self) -> None:
        """Halt the children; the next tick stops at the first child that is running."""
        self.farthest = 0
        super().halt()

    def tick(self) -> Status:
        """Tick the children from the first one, until one fails, or the farthest one is running."""
        self.status = Status.RUNNING
        skipped = 0
        for at, child in enumerate(self.children):
            status = child.execute()
            if status is Status.RUNNING and at >= self.farthest:
                self.farthest = at
                return status
            if status is Status.FAILURE:
                self.halt()
                return status
            skipped += status is Status.SKIPPED
        self.halt()
        return Status.SKIPPED if skipped == len(self.children) else Status.SUCCESS


class RoundRobin(RunningNode):
    """`RoundRobin`: ticks the next child after a failure; after a success, the next run begins with the next child.

    Without `wrap_around`, the last child ends the node. Its success is a success, as the documentation of Nav2 says;
    in the code of Nav2 at commit a3a97043, it is a failure.
    """

    present = 0
    failed = 0

    def halt(self) -> None:
        """Halt the children; the next tick begins with the first child."""
        self.present = self.failed = 0
        super().halt()

    def tick(self) -> Status:
        """Tick the present child, and the next ones, until one is running or has succeeded, or all have failed."""
        wraps = truth_port(self.node, "wrap_around", self.board)
        self.status = Status.RUNNING
        skipped = 0
        while self.failed + skipped < len(self.children):
            status = self.children[self.present].execute()
            if status is Status.RUNNING:
                return status
            self.present = (self.present + 1) % len(self.children)
            if status is Status.SUCCESS:
                self.failed = 0
                self.reset_children()
                return status
            skipped += status is Status.SKIPPED
            self.failed += status is Status.FAILURE
            if self.present == 0 and not wraps:
                break
        all_skipped = skipped == len(self.children)
        self.halt()
        return Status.SKIPPED if all_skipped else Status.FAILURE


class RateController(Decorator):
    """`RateController`: begins the child at the first tick, and again a period after its last success."""

    period = start = 0.0

    def halt(self) -> None:
        """Halt the child, and stop the timer."""
        self.run.due.pop(self, None)
        super().halt()

    def tick(self) -> Status:
        """Tick a child that is running or due; else the node is running."""
        begins = self.status is Status.IDLE
        if begins:
            self.period, self.start = 1 / self._rate(), self.run.now()
        self.status = Status.RUNNING
        is_due = begins or self.run.now() >= self.start + self.period
        if not is_due and self.child.status is not Status.RUNNING:
            return Status.RUNNING
        self.run.due.pop(self, None)
        status = self.child.execute()
        if status is Status.SUCCESS:
            self.start = self.run.now()
            self.run.due[self] = self.start + self.period
        return status

    def _rate(self) -> float:
        rate = number_port(self.node, "hz", self.board)
        if not (0 < rate < math.inf):
            message = f"{self.node.element}: the port 'hz' is a number above 0, not {shown(rate)}"
            raise InputError(message, place=self.node.place)
        return rate
