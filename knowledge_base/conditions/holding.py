"""How long a condition has been true without a break."""

from __future__ import annotations

from collections.abc import Callable

from knowledge_base.conditions.clock import Clock, Timer


class Hold:
    """A timer that runs while a condition is true.

    `due` is reckoned when the truth changes, under the lock; `start` and `stop` come later, outside the lock
    and in commit order.
    """

    def __init__(self, clock: Clock, seconds: float) -> None:
        self._clock = clock
        self._seconds = seconds
        self._timer: Timer | None = None

    def due(self) -> float:
        """When a condition that becomes true now has been true for long enough."""
        return self._clock.now() + self._seconds

    def start(self, due: float, over: Callable[[], None]) -> None:
        """Call `over` when it is that late."""
        self._timer = self._clock.call_later(max(0.0, due - self._clock.now()), over)

    def stop(self) -> None:
        """It has become false, or nobody asks any more."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()
