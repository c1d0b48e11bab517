"""Sequences and fallbacks: nodes that tick their children in order."""

from __future__ import annotations

from dsc.trees.running.node import RunningNode, Status, reset


class InOrder(RunningNode):
    """Base of sequences and fallbacks with a present child; `PASSES` continues with the next child."""

    PASSES: Status
    ENDS: Status
    YIELDS = False
    """Whether the node returns `RUNNING` between two children that end in one tick."""
    KEEPS = False
    """Whether the node begins again at the child that ended it."""

    present = 0
    skipped = 0

    def tick(self) -> Status:
        """Tick the present child, and the next ones, until one is running or ends the node."""
        if self.status is not Status.RUNNING:
            self.skipped = 0
        self.status = Status.RUNNING
        while self.present < len(self.children):
            child = self.children[self.present]
            before = child.status
            status = child.execute()
            if status is Status.RUNNING:
                return status
            if status is self.ENDS:
                self._end()
                return status
            self.present += 1
            self.skipped += status is Status.SKIPPED
            more = self.present < len(self.children)
            if status is self.PASSES and self.YIELDS and more and self.wake(before):
                return Status.RUNNING
        all_skipped = self.skipped == len(self.children)
        self.reset_children()
        self.present = self.skipped = 0
        return Status.SKIPPED if all_skipped else self.PASSES

    def _end(self) -> None:
        if self.KEEPS:
            for child in self.children[self.present :]:
                reset(child)
            return
        self.reset_children()
        self.present = 0

    def halt(self) -> None:
        """Halt the node; the next tick begins with the first child, except with memory."""
        if not self.KEEPS:
            self.present = self.skipped = 0
        super().halt()


class SequenceNode(InOrder):
    """`Sequence`: begins again with the first child after a failure."""

    PASSES, ENDS = Status.SUCCESS, Status.FAILURE


class AsyncSequence(SequenceNode):
    """`AsyncSequence`: a `Sequence` that can be halted between two children."""

    YIELDS = True


class SequenceWithMemory(SequenceNode):
    """`SequenceWithMemory`: begins again with the child that failed."""

    YIELDS = KEEPS = True


class FallbackNode(InOrder):
    """`Fallback`: ticks the next child after a failure."""

    PASSES, ENDS = Status.FAILURE, Status.SUCCESS


class AsyncFallback(FallbackNode):
    """`AsyncFallback`: a `Fallback` that can be halted between two children."""

    YIELDS = True


class Reactive(RunningNode):
    """Base of the nodes that begin each tick with the first child; a running child halts all others."""

    PASSES: Status
    ENDS: Status

    def tick(self) -> Status:
        """Tick the children from the first one, until one is running or ends the node."""
        self.status = Status.RUNNING
        all_skipped = True
        for child in self.children:
            status = child.execute()
            all_skipped = all_skipped and status is Status.SKIPPED
            if status is Status.RUNNING:
                for other in self.children:
                    if other is not child:
                        reset(other)
                return status
            if status is self.ENDS:
                self.reset_children()
                return status
            if status is Status.SKIPPED:
                reset(child)
        self.reset_children()
        return Status.SKIPPED if all_skipped else self.PASSES


class ReactiveSequence(Reactive):
    """`ReactiveSequence`: tests the earlier children again at each tick."""

    PASSES, ENDS = Status.SUCCESS, Status.FAILURE


class ReactiveFallback(Reactive):
    """`ReactiveFallback`: tests the earlier children again at each tick."""

    PASSES, ENDS = Status.FAILURE, Status.SUCCESS
