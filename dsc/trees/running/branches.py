"""Nodes that choose one of their children: `IfThenElse`, `WhileDoElse` and `Switch`."""

from __future__ import annotations

from dsc.trees.blackboard import EMPTY
from dsc.trees.evaluation import same_text, text_of_value
from dsc.trees.running.node import RunningNode, Status, reset
from dsc.trees.running.ports import key_of
from knowledge_base.errors import InputError


class Branch(RunningNode):
    """Base of the nodes whose first child is their condition."""

    def refuse_skipped(self) -> InputError:
        """Return the error for a condition that was skipped, which decides for no child."""
        message = f"{self.node.element}: its condition {self.children[0].node.element} was skipped"
        return InputError(message, place=self.children[0].node.place)


class IfThenElse(Branch):
    """`IfThenElse`: the condition is tested once, before the chosen child."""

    chosen = 0

    def halt(self) -> None:
        """Halt the children; the next tick tests the condition."""
        self.chosen = 0
        super().halt()

    def tick(self) -> Status:
        """Test the condition if no child is chosen, then tick the chosen child."""
        self.status = Status.RUNNING
        if self.chosen == 0:
            status = self.children[0].execute()
            if status is Status.SKIPPED:
                raise self.refuse_skipped()
            if status is Status.RUNNING or (status is Status.FAILURE and len(self.children) == 2):
                return status
            self.chosen = 1 if status is Status.SUCCESS else 2
        status = self.children[self.chosen].execute()
        if status is not Status.RUNNING:
            self.reset_children()
            self.chosen = 0
        return status


class WhileDoElse(Branch):
    """`WhileDoElse`: the condition is tested at each tick; another choice halts the running child."""

    def tick(self) -> Status:
        """Test the condition, then tick the chosen child."""
        self.status = Status.RUNNING
        status = self.children[0].execute()
        if status is Status.SKIPPED:
            raise self.refuse_skipped()
        if status is Status.RUNNING:
            return status
        chosen = 1 if status is Status.SUCCESS else 2
        if len(self.children) == 3:
            reset(self.children[3 - chosen])
        if chosen < len(self.children):
            status = self.children[chosen].execute()
        if status is not Status.RUNNING:
            self.reset_children()
        return status


class Switch(RunningNode):
    """`Switch2` to `Switch6`: ticks the child whose case equals the variable, else the last child."""

    ticked: int | None = None

    def halt(self) -> None:
        """Halt the children."""
        self.ticked = None
        super().halt()

    def tick(self) -> Status:
        """Tick the matching child; halt the child that ran before."""
        match = self._match()
        if self.ticked is not None and self.ticked != match:
            reset(self.children[self.ticked])
        status = self.children[match].execute()
        self.ticked = match if status is Status.RUNNING else None
        if status in {Status.SUCCESS, Status.FAILURE}:
            self.reset_children()
        return status

    def _match(self) -> int:
        default = len(self.children) - 1
        variable = self._text("variable")
        if variable is None:
            return default
        for at in range(default):
            case = self._text(f"case_{at + 1}")
            if case is not None and same_text(variable, case, self.run.enums):
                return at
        return default

    def _text(self, port: str) -> str | None:
        text = self.node.ports.get(port)
        if text is None:
            return None
        key = key_of(port, text)
        if key is None:
            return text
        entry = self.board.entry(key)
        return None if entry is None or entry.value is EMPTY else text_of_value(entry.value)
