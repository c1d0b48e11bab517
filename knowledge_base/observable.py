"""A world that tells of its changes: the listening half of the knowledge base."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from weakref import WeakSet

from knowledge_base.conditions.condition import Condition, Fire
from knowledge_base.conditions.damping import TimerClock
from knowledge_base.conditions.installed import Installed, terms
from knowledge_base.conditions.notification import Listener, Notifier
from knowledge_base.conditions.watch import Watch, watch
from knowledge_base.errors import StoreError
from knowledge_base.facts import Value
from knowledge_base.language.expression import Expression
from knowledge_base.view import View
from knowledge_base.world.state import WorldState


class Observable(View):
    """A view of a world that changes; who listens is called in commit order, when the lock is released."""

    def __init__(self, state: WorldState, version: int) -> None:
        super().__init__(state, version)
        self._announcer = Notifier(self._lock)
        self._installed = Installed(state, version, self._lock, self._announcer)
        self._watches: WeakSet[Watch] = WeakSet()
        self._closed = False

    def close(self) -> None:
        """Cancel what is installed and end what is watched: whoever waits is told, no timer goes on."""
        with self._lock:
            self._closed = True
            conditions, watches = self._installed.conditions(), list(self._watches)
        for condition in conditions:
            condition.cancel()
        for one in watches:
            one.close()

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every committed change from now on; the function returned ends that.

        Changes come in commit order; a commit that changes nothing is not announced. A listener may ask and
        change the knowledge base. When listeners raise, the committing call raises an `ExceptionGroup`
        after all have been told; the change stays.
        """
        return self._announcer.subscribe(listener)

    def install(
        self,
        text: str | Expression,
        params: Mapping[str, Value] | None = None,
        *,
        fire: Fire = "edge",
        hold_s: float = 0.0,
        once: bool = False,
        hysteresis: float | None = None,
        clock: TimerClock | None = None,
    ) -> Condition:
        """Keep a condition evaluated at every version from now on, and fire when it becomes true (S2.4).

        What an update costs depends on what it changes, see `conditions.relation`. What is true already does
        not fire; it begins to hold.

        Args:
            text: a condition; it is true if there are values for its free variables, which then are its witness.
            params: variables that have a value already.
            fire: `edge`, when it becomes true; `each`, also at every change of the set of its witnesses while
                it is true.
            hold_s: it fires when it has been true for so many seconds without a break.
            once: it is cancelled by its first firing.
            hysteresis: it stays true until its comparisons fail by more than that: `(> (level) 9)` becomes
                true above 9 and false when `(> (level) (- 9 hysteresis))` is.
            clock: what `hold_s` is measured with.

        Raises:
            InputError: as for `query`; a negative or not finite time, a time without a clock, a hysteresis
                without a comparison; another word for `fire`.
            StoreError: the knowledge base is closed.
        """
        firing = terms(fire, hold_s=hold_s, once=once, clock=clock)
        with self._lock:
            self._require_open()
            params = self._questions.given(text, params, self._state, "answers")
            e = self._questions.query(text, params, self._state)
            condition = self._installed.install(e, params, firing, hysteresis)
        self._announcer.deliver()
        return condition

    def watch(
        self, pattern: str | Expression | None = None, params: Mapping[str, Value] | None = None, *, limit: int = 1000
    ) -> Watch:
        """The committed changes from now on that touch `pattern`, as an asynchronous iterator.

        When `limit` changes wait to be read and another one comes, all of them are dropped and the next item
        is a `Missed` that says since when.

        Args:
            pattern: a predicate, function or type with arguments, e.g. `(on ?o table)`; `None` for all changes.
            params: variables of the pattern that have a value.
            limit: how many changes may wait, at least 1.

        Raises:
            InputError: the pattern is none, or names what is not declared.
            StoreError: the knowledge base is closed.
        """
        with self._lock:
            self._require_open()
            made = watch(self, pattern, {} if params is None else params, limit)
            self._watches.add(made)
            return made

    def _require_open(self) -> None:
        if self._closed:
            raise StoreError("the knowledge base is closed; it can only be asked")
