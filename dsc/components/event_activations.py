"""Who has activated the events of a component (S0.6)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Test = Callable[..., None]
"""Is given the values of an event each time there are new ones."""


class EventActivations:
    """Tests by event, and the last values of each."""

    def __init__(self) -> None:
        self._values: dict[str, tuple[Any, ...]] = {}
        self._tests: dict[str, list[Test]] = {}

    def __getstate__(self) -> dict[str, object]:
        """What goes to another process: who has activated something here has not there."""
        return {"_values": self._values, "_tests": {}}

    def active(self, event: str) -> bool:
        """Whether anybody has activated the event; nobody need look for it otherwise."""
        return bool(self._tests.get(event))

    def update(self, event: str, values: tuple[Any, ...]) -> None:
        """Call all tests of the event."""
        self._values[event] = values
        for test in tuple(self._tests.get(event, ())):
            test(*values)

    @contextmanager
    def tested(self, event: str, test: Test) -> Iterator[None]:
        """Inside, the test is called with the event's values: now if there are any, and with each update."""
        tests = self._tests.setdefault(event, [])
        tests.append(test)
        try:
            if event in self._values:
                test(*self._values[event])
            yield
        finally:
            tests.remove(test)
