"""Turns of a component: it executes one skill at a time unless it is `concurrent`; other skills wait by rank (S1.21).

The turns belong to the component and not to a run, so that several runs share them.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Protocol

from dsc.components.hooks import cancel_once
from dsc.errors import PreemptedError
from dsc.rank import Rank


class Claimant(Protocol):
    """A skill that needs the turn of its component."""

    def describe(self) -> str:
        """Return the skill with its state, as text for people."""
        ...

    def begin(self, *, waited: bool) -> None:
        """Begin, since the claim has the turn, after a wait or without one."""
        ...

    def wait(self, holder: str) -> None:
        """Note that the claim begins to wait for the skill `holder`."""
        ...

    def lose(self, taker: str) -> None:
        """Leave soon, since the skill `taker` needs the turn."""
        ...


@dataclass(eq=False, slots=True)
class Claim:
    """A claim to the turn of a component.

    Attributes:
        turns: the turns of the component.
        claimant: the skill.
        rank: the rank of the skill.
        waits: whether the claimant knows that it waits.
        lost: whether another claim preempts this one.
        ended: whether the skill was cancelled, and only cleans up.
    """

    turns: Turns
    claimant: Claimant
    rank: Rank
    waits: bool = False
    lost: bool = False
    ended: bool = False

    @property
    def has_turn(self) -> bool:
        """Whether the claim has the turn."""
        return self.turns.holder is self

    def end(self) -> None:
        """Leave the wait; a claim that has the turn leaves when its skill has stopped."""
        if self.has_turn:
            self.ended = True
        else:
            self.leave()

    def leave(self) -> None:
        """Leave the turn, or the wait for it; the next claim gets a free turn."""
        self.turns.remove(self)


@dataclass(eq=False, slots=True)
class Turns:
    """The claim that has the turn of one component, and the claims that wait for it.

    Attributes:
        holder: the claim that has the turn; `None` if the component is free.
        waiting: the other claims, the earliest first.
    """

    holder: Claim | None = None
    waiting: list[Claim] = field(default_factory=list)

    def __reduce__(self) -> tuple[type[Turns], tuple[()]]:
        """Pickle without claims: the copy of the component in a skill's process executes nothing else."""
        return Turns, ()

    def give(self) -> None:
        """Give the turn of a free component to the first claim by rank; otherwise let the first claim preempt."""
        if not self.waiting:
            return
        first = self.waiting[0]
        if len(self.waiting) > 1:
            first = max(self.waiting, key=lambda claim: claim.rank[:3])  # of equals the earliest
        if self.holder is None:
            self.waiting.remove(first)
            self.holder = first
            first.claimant.begin(waited=first.waits)
        elif first.rank.takes_from(self.holder.rank) and not (self.holder.lost or self.holder.ended):
            self.holder.lost = True
            self.holder.claimant.lose(first.claimant.describe())
        for claim in self.waiting:
            if not (claim.waits or self.holder.ended):  # a skill that was cancelled soon stops
                claim.waits = True
                claim.claimant.wait(self.holder.claimant.describe())

    def remove(self, claim: Claim) -> None:
        """Remove a claim; if it had the turn, the next claim gets it."""
        if claim is self.holder:
            self.holder = None
            self.give()
        elif claim in self.waiting:
            self.waiting.remove(claim)


class _Awaited:
    """A claimant whose skill awaits its turn in the task that claims it."""

    def __init__(self, skill: str, task: asyncio.Task[object] | None, waits: Callable[[str], None]) -> None:
        self._skill = skill
        self._task = task
        self._waits = waits
        self.turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.taker = ""

    def describe(self) -> str:
        """Return the skill as text."""
        return self._skill

    def begin(self, *, waited: bool) -> None:
        """Resolve the awaited turn."""
        if waited:
            self._waits("")
        if not self.turn.done():
            self.turn.set_result(None)

    def wait(self, holder: str) -> None:
        """Report the holder."""
        self._waits(holder)

    def lose(self, taker: str) -> None:
        """Cancel the task."""
        self.taker = taker
        if self._task is not None:
            cancel_once(self._task)


@asynccontextmanager
async def turn_of(turns: Turns, skill: str, rank: Rank, waits: Callable[[str], None]) -> AsyncIterator[None]:
    """Wait for the turn of a component, and hold it in the block.

    Args:
        turns: the turns of the component.
        skill: the skill, as text for people.
        rank: the rank of the skill.
        waits: receives the skill that has the turn when the wait begins, and an empty text when it ends.

    Raises:
        PreemptedError: a skill with a higher priority has taken the turn; the block was cancelled.
    """
    task = asyncio.current_task()
    claimant = _Awaited(skill, task, waits)
    claim = Claim(turns, claimant, rank)
    turns.waiting.append(claim)
    turns.give()
    try:
        await claimant.turn
        yield
    except asyncio.CancelledError:
        if not claimant.taker or task is None or task.uncancel() > 0:  # or the task was cancelled by others, too
            raise
        raise PreemptedError(claimant.taker) from None
    finally:
        claim.leave()
