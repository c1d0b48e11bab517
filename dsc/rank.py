"""The rank of a skill among the skills that wait for one component (S1.21)."""

from __future__ import annotations

from typing import NamedTuple


class Rank(NamedTuple):
    """Priority of a skill; of several skills that wait, the one with the largest rank gets the component first.

    Attributes:
        priority: the declared priority of the innermost state around the skill that has one, else 0.
        handles: whether the skill belongs to a handler; of equal priorities, handlers come before plots.
        depth: the number of states around the skill; then inner skills come before outer skills.
        preempts: whether the skill takes the component from a skill with a lower priority.
    """

    priority: float = 0.0
    handles: bool = False
    depth: int = 0
    preempts: bool = False

    def takes_from(self, other: Rank) -> bool:
        """Return whether the skill takes the component from a skill with the rank `other`."""
        return self.preempts and self[:2] > other[:2]


ORDINARY = Rank()
"""The rank of a skill without declarations."""
