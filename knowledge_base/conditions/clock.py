"""Time, injected: what a hold time is measured with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol


class Timer(Protocol):
    """A call that is due later."""

    def cancel(self) -> object:
        """Do not make the call."""
        ...


class Clock(Protocol):
    """Gives the time and calls back; both are used from whatever thread commits a change."""

    def now(self) -> float:
        """Seconds from some fixed moment."""
        ...

    def call_later(self, delay_s: float, callback: Callable[[], None]) -> Timer:
        """Call `callback` once when so many seconds have passed."""
        ...
