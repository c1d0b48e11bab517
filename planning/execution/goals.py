"""Queue of the goals of a robot, kept in its store: it survives a kill of the program and a suspended run."""

from __future__ import annotations

import asyncio
import math
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from sqlite3 import Connection
from typing import Literal, get_args

from dsc.loop_calls import LoopCalls
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.user_objects import shown
from planning.problem.construction import check_goal

GoalState = Literal["waiting", "running", "reached", "failed", "withdrawn"]
_TABLE = (
    "CREATE TABLE IF NOT EXISTS goals (id INTEGER PRIMARY KEY, goal TEXT NOT NULL, priority REAL NOT NULL,"
    " deadline REAL, state TEXT NOT NULL, reason TEXT NOT NULL)"
)
MOST_ENDED = 1_000
"""The maximum number of ended goals that the queue keeps; the oldest are dropped."""
LATE = "its deadline has passed"
"""The reason of a goal that failed at its deadline."""


@dataclass(frozen=True, slots=True)
class QueuedGoal:
    """A goal in the queue.

    Attributes:
        id: the number of the goal in its queue.
        goal: the condition to reach.
        priority: goals with a higher priority are served first, and equal ones in the order of their numbers.
        deadline: POSIX second after which the goal is not begun, and at which its run ends; `None` without a deadline.
        state: waiting, running, reached, failed or withdrawn.
        reason: the reason of the end; empty before it.
    """

    id: int
    goal: str
    priority: float
    deadline: float | None
    state: GoalState = "waiting"
    reason: str = ""


class GoalQueue:
    """The goals of a robot; `Robot.serve` or the plot `serve_goals` serves them.

    Any thread may call `put`, `withdraw`, `get` and `list`. The other methods belong to the loop that serves the goals.

    Args:
        knowledge: the knowledge base, against whose schema goals are checked.
        kept: whether the file of the knowledge base keeps the queue.
        now: returns POSIX seconds.
    """

    def __init__(self, knowledge: KnowledgeBase, *, kept: bool, now: Callable[[], float] = time.time) -> None:
        self._knowledge = knowledge
        self._kept = kept
        self._now = now
        self._goals: dict[int, QueuedGoal] = {}
        self._cancel: dict[int, Callable[[str], object]] = {}
        self._arrival = asyncio.Event()
        self._calls = LoopCalls()
        self._numbering = threading.Lock()
        self._closed = False
        self._ends: dict[int, asyncio.Event] = {}
        if kept:
            with self._file() as connection:
                connection.execute(_TABLE)
                rows = connection.execute("SELECT id, goal, priority, deadline, state, reason FROM goals").fetchall()
            self._goals = {row[0]: QueuedGoal(*row) for row in rows}
        self._last = max(self._goals, default=0)

    def put(
        self, goal: str, *, priority: float = 0.0, deadline: float | None = None, replaces: int | None = None
    ) -> int:
        """Add a goal and return its number; with a store, the goal is kept when this call returns.

        Args:
            goal: the condition to reach.
            priority: see `QueuedGoal`.
            deadline: see `QueuedGoal`.
            replaces: the number of a goal that this goal replaces: it is withdrawn, also if it is running.

        Raises:
            InputError: the goal is not a condition, contains an undeclared name, or a number is not finite; or the
                robot is closed.
            UnknownNameError: the queue has no goal with the number `replaces`.
            StoreError: the store cannot be written.
        """
        if self._closed:
            raise InputError("the robot is closed; it serves no further goal")
        check_goal(parse_condition(goal, "goal"), self._knowledge)
        for name, value in (("priority", priority), ("deadline", 0.0 if deadline is None else deadline)):
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise InputError(f"`{name}` is a number, not {shown(value)}")
        if replaces is not None:
            self.withdraw(replaces, "replaced by another goal")
        with self._numbering:
            number = self._last = self._last + 1
        queued = QueuedGoal(number, goal, float(priority), deadline)
        self._write(queued)
        self._calls.call(self._arrival.set)
        return queued.id

    def withdraw(self, number: int, reason: str = "withdrawn") -> None:
        """End a goal that waits or runs; an ended goal stays unchanged.

        Raises:
            UnknownNameError: the queue has no such goal.
            StoreError: the store cannot be written.
        """
        queued = self.get(number)
        if queued.state in ("waiting", "running"):
            self._write(replace(queued, state="withdrawn", reason=reason))
            if (cancel := self._cancel.pop(number, None)) is not None:
                self._calls.call(cancel, reason)

    def get(self, number: int) -> QueuedGoal:
        """Return the goal of that number; raise `UnknownNameError` if there is no such goal."""
        if number not in self._goals:
            raise UnknownNameError(f"there is no goal {number}", found=str(number), valid=map(str, self._goals))
        return self._goals[number]

    def list(self, *states: GoalState) -> tuple[QueuedGoal, ...]:
        """Return the goals in these states in the order of service, by default those that wait or run.

        Raises:
            UnknownNameError: there is no such state.
        """
        wanted = states or ("waiting", "running")
        unknown = next((state for state in wanted if state not in get_args(GoalState)), None)
        if unknown is not None:
            raise UnknownNameError(f"a goal is never '{unknown}'", found=str(unknown), valid=get_args(GoalState))
        found = [one for one in [*self._goals.values()] if one.state in wanted]
        return tuple(sorted(found, key=lambda one: (one.state == "waiting", -one.priority, one.id)))

    async def end_of(self, number: int) -> QueuedGoal:
        """Wait until a goal has ended, and return it; raise `UnknownNameError` if there is no such goal."""
        self._calls.bind()
        while self.get(number).state in ("waiting", "running"):
            await self._ends.setdefault(number, asyncio.Event()).wait()
        return self.get(number)

    # -- for those who serve the goals -----------------------------------------------------------------------

    def recover(self) -> None:
        """Let the running goals without a server wait again, since their run was interrupted."""
        for left in self.list("running"):
            if left.id not in self._cancel:
                self._write(replace(left, state="waiting"))

    async def next(self) -> QueuedGoal | None:
        """Return the next waiting goal before its deadline; wait for one, or return `None` after `close`."""
        self._calls.bind()
        while not self._closed:
            self._arrival.clear()  # before the look: another thread may put a goal at any time
            found = self.first()
            if found is not None:
                return found
            await self._arrival.wait()
        return None

    def close(self) -> None:
        """Take no further goals; those that wait stay in the store."""
        self._closed = True
        self._calls.call(self._arrival.set)

    def first(self) -> QueuedGoal | None:
        """Return the next waiting goal, or `None`; end the goals whose deadline has passed."""
        for one in self.list("waiting"):
            if one.deadline is None or one.deadline > self._now():
                return one
            self.end(one.id, reached=False, reason=LATE)
        return None

    def begin(self, number: int, cancel: Callable[[str], object]) -> float | None:
        """Note that a goal is being served; return the seconds until its deadline. `cancel` ends its run."""
        with suppress(RuntimeError):  # without a loop, nothing waits
            self._calls.bind()
        queued = self.get(number)
        self._write(replace(queued, state="running"))
        self._cancel[number] = cancel
        return None if queued.deadline is None else max(0.0, queued.deadline - self._now())

    def release(self, number: int) -> None:
        """Note that a goal has no server; its state stays unchanged."""
        self._cancel.pop(number, None)

    def end(self, number: int, *, reached: bool, reason: str) -> None:
        """Note the end of a goal; a withdrawn goal stays withdrawn."""
        self.release(number)
        if self.get(number).state != "withdrawn":
            self._write(replace(self.get(number), state="reached" if reached else "failed", reason=reason))

    def _write(self, queued: QueuedGoal) -> None:
        dropped = [one.id for one in self._goals.values() if one.state not in ("waiting", "running")][:-MOST_ENDED]
        if self._kept:
            with self._file() as connection:
                row = queued.id, queued.goal, queued.priority, queued.deadline, queued.state, queued.reason
                connection.execute("INSERT OR REPLACE INTO goals VALUES (?, ?, ?, ?, ?, ?)", row)
                connection.executemany("DELETE FROM goals WHERE id = ?", [(number,) for number in dropped])
        self._goals[queued.id] = queued
        if queued.state not in ("waiting", "running") and (end := self._ends.pop(queued.id, None)) is not None:
            self._calls.call(end.set)
        for number in dropped:
            self._goals.pop(number, None)

    def _file(self) -> AbstractContextManager[Connection]:
        return self._knowledge.together()
