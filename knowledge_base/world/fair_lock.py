"""A lock that is had in order of arrival, and that an interrupt never leaves taken.

An interrupt (`KeyboardInterrupt`) may come at any moment, which is: as a function is entered, as a loop begins again,
and when a call has returned. So nothing that must be undone is done by two calls without a handler around them, and
what undoes it is one call into C, before which nothing can come: the lock *is* Python's own, and given back by its own
`__exit__`; a gate is a queue, which may be opened twice.
"""

from __future__ import annotations

from collections import deque
from queue import SimpleQueue
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import TracebackType

    class RLock:
        """What is used of Python's own, which typeshed calls final; it is not."""

        def acquire(self, *, blocking: bool = True) -> bool:
            """Get it, at once or not at all unless `blocking`; whether that was possible."""

        def release(self) -> None:
            """Give it back, once."""

        def __exit__(
            self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
        ) -> None: ...
        def _is_owned(self) -> bool: ...

else:
    from _thread import RLock  # the type: `threading.RLock` is a function

PATIENCE_S = 0.0005
"""How long the first in line lets others go first: a few changes' time, some times what handing the lock over takes."""


class FairLock(RLock):
    """A lock and those who wait for it; used as a context manager, also again by who has it.

    Whoever comes and finds the lock free may go first as long as the first in line has been that for less than its
    patience; then all join the line at its end. (To hand the lock from thread to thread each time costs more than
    most of what is done with it.)

    Args:
        patience_s: how long the first in line lets others go first, in seconds.
    """

    held = RLock._is_owned  # noqa: SLF001  by this thread; `threading.Condition` asks so, too

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._patience_s = patience_s
        self._gates: deque[SimpleQueue[None]] = deque()  # that of the first is open
        self._due = 0.0  # when the patience of the first is over

    @property
    def length(self) -> int:
        """How many wait."""
        return len(self._gates)

    def __enter__(self) -> bool:
        return self.get()

    def get(self) -> bool:
        """Wait for the lock; whether this thread had it already."""
        again = self.held()
        try:
            may_go = again or not self._gates or monotonic() < self._due
            if not (may_go and self.acquire(blocking=False)):
                self._wait()
        except BaseException:
            self.let_go()
            raise
        return again

    def let_go(self) -> None:
        """Give back what an interrupted call may have got, or may not."""
        try:
            self.release()
        except RuntimeError:  # it had not come to that
            return

    def _wait(self) -> None:
        """Stand in line until the lock is had; who leaves opens the gate of who is first then."""
        gate: SimpleQueue[None] = SimpleQueue()
        try:
            try:
                self._gates.append(gate)
                if self._gates[0] is gate:
                    gate.put(None)
                    self._due = monotonic() + self._patience_s
                gate.get()
                self.acquire()
            finally:
                self._gates.remove(gate)
        finally:
            try:
                self._gates[0].put(None)
            except IndexError:  # nobody waits
                pass
            else:
                self._due = monotonic() + self._patience_s
