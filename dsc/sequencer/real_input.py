"""Waits of skills for real input: sockets, pipes and processes of their components.

Simulated time must not jump during such a wait, since the answer needs real time. A component may keep a socket open
while its skills sleep; such a socket does not count. A thread that calls the loop is not visible here: its skill uses
`clock.hold`.
"""

from __future__ import annotations

import asyncio
import selectors
import time
from asyncio import futures
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from dsc.components.hooks import active_component

TasksOf = Callable[[str], Iterable[asyncio.Task[None]]]
"""Function that returns the tasks of the running skills of a component."""
_WAKES_SLEEPER = futures._set_result_unless_cancelled  # type: ignore[attr-defined]  # noqa: SLF001  # of `asyncio.sleep`


class RealInput:
    """The open sockets, pipes and processes of a loop, with the components that opened them.

    Args:
        selector: the selector of the loop.

    Attributes:
        attended: returns, each for one dispatcher, the tasks of skills.
    """

    def __init__(self, selector: selectors.BaseSelector) -> None:
        self._selector = selector
        self.attended: list[TasksOf] = []
        self._processes: dict[asyncio.SubprocessTransport, str | None] = {}
        self._since: float | None = None

    def add_process(self, process: asyncio.SubprocessTransport) -> None:
        """Add a process that the present task has started."""
        self._processes[process] = active_component.get()

    @property
    def may_come(self) -> bool:
        """Whether anything besides the loop's own pipe is open."""
        return bool(self._processes) or len(self._selector.get_map()) > 1

    def is_awaited(self, timers: Iterable[asyncio.TimerHandle]) -> bool:
        """Return whether a skill of a component with open input waits for anything but a timer.

        Args:
            timers: the scheduled calls of the loop.
        """
        owners = set(self._owners())
        tasks = [task for name in owners for tasks_of in self.attended for task in tasks_of(name)]
        if not tasks:
            return False
        sleeping = {timer._args[0] for timer in timers if timer._callback is _WAKES_SLEEPER}  # type: ignore[attr-defined]  # noqa: SLF001
        return any(_waits_otherwise(task, sleeping) for task in tasks)

    def waited(self) -> float:
        """Return the real seconds since the wait began; the first call begins it."""
        now = time.monotonic()
        if self._since is None:
            self._since = now
        return now - self._since

    def end_wait(self) -> None:
        """End the wait, as simulated time advances."""
        self._since = None

    def _owners(self) -> Iterator[str]:
        self._processes = {one: owner for one, owner in self._processes.items() if one.get_returncode() is None}
        yield from filter(None, self._processes.values())
        for key in self._selector.get_map().values():
            for handle in key.data or ():
                owner = None if handle is None else handle._context.get(active_component)  # noqa: SLF001  # set when opened
                if owner is not None:
                    yield owner


def _waits_otherwise(waiting: Any, sleeping: set[Any]) -> bool:
    """Return whether a task, or any of the tasks that it awaits, waits for something else than a timer."""
    if isinstance(waiting, asyncio.Task):
        return waiting._fut_waiter is not None and _waits_otherwise(waiting._fut_waiter, sleeping)  # type: ignore[attr-defined]  # noqa: SLF001
    children = getattr(waiting, "_children", None)  # of `asyncio.gather`
    if children:
        return any(_waits_otherwise(child, sleeping) for child in children)
    return not waiting.done() and waiting not in sleeping
