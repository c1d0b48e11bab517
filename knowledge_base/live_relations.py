"""Live relations of a knowledge base: rows that a running program provides, for queries and installed conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from knowledge_base.conditions.installed import Installed
from knowledge_base.conditions.notification import Notifier
from knowledge_base.world.live_rows import Rows
from knowledge_base.world.state import WorldState


class LiveRelations:
    """The relations that programs provide in one knowledge base."""

    def __init__(self, state: WorldState, installed: Installed, notifier: Notifier) -> None:
        self._state, self._installed, self._notifier = state, installed, notifier
        self._listeners: list[Callable[[], None]] = []

    def provide(self, rows: Mapping[str, Rows]) -> Callable[[], None]:
        """Let queries read rows of declared relations; return a function that ends this."""
        with self._notifier.lock:
            self._state.provide(rows)
        self.renew(rows)

        def withdraw() -> None:
            with self._notifier.lock:
                self._state.withdraw(rows)
            self.renew(rows)

        return withdraw

    def subscribe(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Call `listener` after each change of relations that were read; return a function that ends this."""
        with self._notifier.lock:
            self._listeners.append(listener)

        def unsubscribe() -> None:
            with self._notifier.lock:
                self._listeners.remove(listener)

        return unsubscribe

    def renew(self, names: Iterable[str]) -> bool:
        """Evaluate the conditions on relations after a change of the program; return whether they were read."""
        with self._notifier.lock:
            live = self._state.live
            read = [name for name in names if name in live.read]
            if not read:
                return False
            ended, begun = live.news(read, self._installed.reads)
            if ended or begun:
                self._installed.renew(ended, begun)
            self.announce()
        self._notifier.deliver()
        return True

    def announce(self) -> None:
        """Queue the calls of the listeners; the caller has the lock."""
        for listener in self._listeners:
            self._notifier.queue(listener)
