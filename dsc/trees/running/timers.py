"""Nodes with a timer: `Delay`, `Timeout` and `Sleep`; each one ends at the first tick after its time."""

from __future__ import annotations

from dsc.trees.running.node import COMPLETE, Decorator, RunningNode, Status, reset
from dsc.trees.running.ports import integer_port


class Delay(Decorator):
    """`Delay`: ticks the child after a time."""

    begun = False

    def halt(self) -> None:
        """Halt the child, and stop the timer."""
        self.begun = False
        self.run.due.pop(self, None)
        super().halt()

    def tick(self) -> Status:
        """Wait for the timer, then tick the child."""
        milliseconds = integer_port(self.node, "delay_msec", self.board)
        if not self.begun:
            self.begun = True
            self.status = Status.RUNNING
            self.run.due[self] = self.run.now() + milliseconds / 1000
        if self.run.due.get(self, 0.0) > self.run.now():
            return Status.RUNNING
        self.run.due.pop(self, None)
        status = self.child.execute()
        if status in COMPLETE:
            self.begun = False
            reset(self.child)
        return status


class Timeout(Decorator):
    """`Timeout`: halts the child after a time, and fails."""

    begun = False

    def halt(self) -> None:
        """Halt the child, and stop the timer."""
        self._stop()
        super().halt()

    def _stop(self) -> None:
        self.begun = False
        self.run.due.pop(self, None)

    def tick(self) -> Status:
        """Tick the child, or halt it if its time has passed."""
        milliseconds = integer_port(self.node, "msec", self.board)
        if not self.begun:
            self.begun = True
            self.status = Status.RUNNING
            if milliseconds > 0:
                self.run.due[self] = self.run.now() + milliseconds / 1000
        elif self in self.run.due and self.run.due[self] <= self.run.now():
            del self.run.due[self]
            if self.child.status is Status.RUNNING:
                reset(self.child)
                self.begun = False
                return Status.FAILURE
        status = self.child.execute()
        if status in COMPLETE:
            self._stop()
            reset(self.child)
        return status


class Sleep(RunningNode):
    """`Sleep`: succeeds after a time."""

    def halt(self) -> None:
        """Stop the timer."""
        self.run.due.pop(self, None)
        super().halt()

    def tick(self) -> Status:
        """Start the timer, or test it."""
        if self.status is Status.IDLE:
            milliseconds = integer_port(self.node, "msec", self.board)
            if milliseconds <= 0:
                return Status.SUCCESS
            self.run.due[self] = self.run.now() + milliseconds / 1000
            return Status.RUNNING
        if self.run.due.get(self, 0.0) > self.run.now():
            return Status.RUNNING
        self.run.due.pop(self, None)
        return Status.SUCCESS
