"""The knowledge base: one consistent world model for all who ask, change and listen (S4.2, S4.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from threading import RLock, get_ident

from knowledge_base.announcement import Announcer, Listener
from knowledge_base.conditions.clock import Clock
from knowledge_base.conditions.condition import Condition, Fire
from knowledge_base.conditions.installed import Installed, terms
from knowledge_base.conditions.watch import Watch, watch
from knowledge_base.errors import ConflictError
from knowledge_base.facts import Change, Delta, Fact, Value
from knowledge_base.language.evaluation import Explanation, explain, holds, query
from knowledge_base.language.expression import Expression
from knowledge_base.overlay import Overlay
from knowledge_base.questions import Questions
from knowledge_base.schema import Schema
from knowledge_base.state import WorldState
from knowledge_base.transaction import Transaction
from knowledge_base.world_graph import Graph, WorldGraph

Binding = dict[str, Value]
"""One answer of a query: variables' names (without `?`) with their values."""


class KnowledgeBase:
    """A world model that may be asked and changed from several threads.

    One lock orders everything: a question sees one version and its answer is a finished list; a change is
    made as a whole or, with an error, not at all. Listeners are called when the lock is released.

    It is itself a `World` (`schema`, `holds`, `match`, `value`, `objects`, `type_of`).
    """

    def __init__(self, schema: Schema) -> None:
        self._lock = RLock()
        self._state = WorldState(schema)
        self._graph = WorldGraph(schema)
        self._questions = Questions()
        self._announcer = Announcer(self._lock)
        self._installed = Installed(self._state, self._lock, self._announcer)
        self._version = 0
        self._writer: tuple[int, str] | None = None

    @property
    def schema(self) -> Schema:
        """What may be said."""
        return self._state.schema

    @property
    def version(self) -> int:
        """How many changes were committed."""
        return self._version

    @property
    def graph(self) -> Graph:
        """The world as a graph, live and read-only; see `world_graph` for its form.

        It follows every commit; other threads must not commit while it is being walked.
        """
        return self._graph.view

    def query(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> list[Binding]:
        """The values of the free variables that make the text true, each choice once.

        Args:
            text: a condition such as `(and (on ?o ?table) (cup ?o))`.
            params: variables that have a value already; they are not part of the answers.

        Raises:
            ParseError: the text is no condition.
            UnknownNameError: an undeclared predicate, function or type, or a thing that is not there.
            SchemaError: a wrong number of arguments or a type that can never fit.
            InputError: a variable occurs only under `not` or in a comparison.
        """
        params = params or {}
        with self._lock:
            return query(self._questions.query(text, params, self._state), self._state, params)

    def ask(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> bool:
        """Whether the text is true; errors as for `query`, and a free variable without a value is one."""
        params = params or {}
        with self._lock:
            return holds(self._questions.condition(text, params, self._state), self._state, params)

    def explain(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> Explanation:
        """Why the text is true or false; errors as for `ask`."""
        params = params or {}
        with self._lock:
            return explain(self._questions.condition(text, params, self._state), self._state, params)

    @contextmanager
    def transaction(self, author: str) -> Iterator[Transaction]:
        """Several changes as one: committed when the block ends, dropped when it raises.

        Other threads wait until the block is left.

        Raises:
            ConflictError: this thread is inside another transaction.
        """
        with self._delivery(), self._lock:
            self._refuse_nesting()
            transaction = Transaction(Overlay(self._state), self._questions)
            self._writer = (get_ident(), author)
            try:
                yield transaction
            finally:
                self._writer = None
                transaction.close()
            self._commit(transaction.delta, author)

    def apply(self, delta: Delta, author: str) -> Change:
        """Commit `delta` as a whole; the change returned holds what really became different.

        Raises:
            UnknownNameError: an undeclared type, predicate or function, or a thing that is not there.
            SchemaError: a wrong number of arguments or a wrong type.
            InputError: a number that is not finite.
            ConflictError: this thread is inside a transaction.
        """
        with self._delivery(), self._lock:
            self._refuse_nesting()
            pending = Overlay(self._state)
            pending.apply(delta)
            return self._commit(pending.delta, author)

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
        clock: Clock | None = None,
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
        """
        params = params or {}
        firing = terms(fire, hold_s=hold_s, once=once, clock=clock)
        with self._delivery(), self._lock:
            e = self._questions.query(text, params, self._state)
            return self._installed.install(e, params, firing, hysteresis)

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
        """
        with self._lock:
            return watch(self, pattern, params or {}, limit)

    def overlay(self) -> Overlay:
        """A world of pending changes on top of this one, which stays as it is."""
        return Overlay(self)

    def snapshot(self) -> WorldState:
        """The world as it is now, as a copy that nothing changes."""
        with self._lock:
            return self._state.copy()

    def facts(self) -> list[Fact]:
        """All facts, predicate by predicate, in order of insertion."""
        with self._lock:
            return list(self._state.facts)

    def values(self) -> dict[Fact, float]:
        """The numeric fluents that were set."""
        with self._lock:
            return dict(self._state.values)

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true."""
        with self._lock:
            return self._state.holds(predicate, args)

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> list[tuple[Value, ...]]:
        """The arguments of all facts that agree with `pattern`; `None` is open; in order of insertion."""
        with self._lock:
            return list(self._state.match(predicate, pattern))

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """At most how many facts agree with `pattern`, without looking through them."""
        with self._lock:
            return self._state.estimate(predicate, pattern)

    def value(self, function: str, args: tuple[Value, ...]) -> float:
        """The numeric fluent's value; 0 until it is set."""
        with self._lock:
            return self._state.value(function, args)

    def objects(self, type_name: str) -> list[str]:
        """The things of that type or a subtype, in order of insertion.

        Raises:
            UnknownNameError: there is no such type.
        """
        with self._lock:
            return self._state.objects(type_name)

    def type_of(self, name: str) -> str | None:
        """The thing's type; `None` if there is no such thing."""
        with self._lock:
            return self._state.type_of(name)

    @contextmanager
    def _delivery(self) -> Iterator[None]:
        """Announces what was committed once the lock inside is released."""
        yield
        self._announcer.deliver()

    def _commit(self, effective: Delta, author: str) -> Change:
        if not effective:
            return Change(self._version, author, effective)
        departures = self._installed.departures(effective)
        self._state.commit(effective)
        self._graph.commit(effective)
        self._version += 1
        change = Change(self._version, author, effective)
        self._announcer.add(change)
        self._installed.commit(effective, departures, self._version)
        return change

    def _refuse_nesting(self) -> None:
        if self._writer is not None and self._writer[0] == get_ident():
            raise ConflictError(f"a transaction by '{self._writer[1]}' is open in this thread already")
