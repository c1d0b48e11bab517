"""Knowledge base: one consistent world model for questions, changes and listeners (S4.2, S4.3)."""

from __future__ import annotations

import sqlite3
import time as wall
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from threading import get_ident
from types import TracebackType
from typing import Self, get_args
from weakref import WeakSet

from knowledge_base.conditions.condition import Condition
from knowledge_base.conditions.damping import Fire, TimerClock, terms
from knowledge_base.conditions.installed import Installed
from knowledge_base.conditions.notification import Listener, Notifier
from knowledge_base.conditions.watch import Watch
from knowledge_base.errors import ConflictError, HistoryError, InputError, StoreError
from knowledge_base.exchange import read_json
from knowledge_base.facts import Change, Delta, Fact, Value
from knowledge_base.journal.archive import Archive
from knowledge_base.journal.file import Durability, located
from knowledge_base.journal.history import History, MemoryHistory, Version, Writer, gone
from knowledge_base.journal.journal import Journal
from knowledge_base.language.checking.inputs import require_delta, require_text, require_time, require_version, shown
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.sources import DataSource, Sources
from knowledge_base.transaction import GroupCommit, Transaction
from knowledge_base.view import View
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

Now = Callable[[], float]
"""Tells the time in seconds."""


class KnowledgeBase(View):
    """A world model that several threads may query and change.

    One lock orders questions and changes by arrival (`world.read_write_lock`). A question sees one version and its
    answer is a finished list. A change is made as a whole or, with an error, not at all. Listeners are called when the
    lock is released.

    The constructor makes one in memory, which keeps its last changes; `open` makes one in a file.

    Args:
        schema: the declarations.
        clock: gives the time of changes, in seconds.
        history: its past, which keeps its changes and replaces the schema; by default the last changes in memory.
    """

    def __init__(self, schema: Schema, clock: Now = wall.time, history: History | None = None) -> None:
        self._history = history or MemoryHistory(Version(WorldState(schema), 0, clock()))
        start = self._history.newest()
        super().__init__(start.state, start.version)
        self._notifier = Notifier(self._lock, start.version)
        self._installed = Installed(start.state, self._notifier)
        self._watches: WeakSet[Watch] = WeakSet()
        self._closed = False
        self._sources = Sources(start.state, lambda: self._graph, self._installed, self._notifier)
        self._clock = clock
        self._time = start.time
        self._writer: tuple[int, str] | None = None

    @classmethod
    def open(
        cls,
        schema: Schema | None,
        path: str | Path | None = None,
        durability: Durability | None = None,
        clock: Now = wall.time,
        *,
        read_only: bool = False,
        new: bool = False,
    ) -> KnowledgeBase:
        """Open a knowledge base in memory or in a file; close it, or use it in a `with` block.

        Args:
            schema: the declarations; `None` takes those of the file. An extension of those of the file (more
                declarations, none changed) is recorded.
            path: the store's file, made when it is missing; `None` is in memory.
            durability: the event that a commit survives: "process" the death of this process (default with a path),
                "power" also a power cut, "memory" none (no path).
            clock: gives the time of changes, in seconds.
            read_only: read a store that another process may be writing; `refresh` follows it.
            new: the file must be a new one.

        Raises:
            StoreError: the file cannot be read or written, is not a store, or has another writer; a foreign file has
                the name of a sidecar file. All files stay unchanged.
            SchemaMismatchError: the file was written with a schema that this one does not extend.
            InputError: there is no schema, or path and durability contradict each other.
        """
        if not (schema is None or isinstance(schema, Schema)):
            raise InputError(f"a schema is a Schema, not {shown(schema)}; Schema.parse reads its text")
        if durability not in (None, *get_args(Durability)):
            valid = get_args(Durability)
            raise InputError(f"there is no durability {shown(durability)}", found=str(durability), valid=valid)
        if path is None:
            if schema is None or durability not in (None, "memory") or read_only or new:
                raise InputError("a knowledge base without a file has a schema and durability 'memory'")
            return cls(schema, clock)
        if durability == "memory":
            raise InputError(f"with the file '{path}' durability is 'process' or 'power', not 'memory'")
        if read_only and new:
            raise InputError("a store that is opened read_only exists already, and is not new")
        file = _resolved(path)
        archive = Archive(file, schema) if read_only else Journal(file, schema, durability or "process", clock, new=new)
        try:
            return cls(archive.schema, clock, archive)
        except BaseException:
            archive.close()
            raise

    @classmethod
    def from_json(
        cls,
        text_or_path: str | Path,
        schema: Schema | None = None,
        clock: Now = wall.time,
        *,
        source: str | None = None,
    ) -> KnowledgeBase:
        """Read the output of `to_json`, a text or a file (a `Path`), into memory at the same version.

        `source` names a text in messages.

        Raises:
            InputError: as `exchange.read_json`.
        """
        state, version = read_json(text_or_path, schema, source)
        return cls(state.schema, clock, MemoryHistory(Version(state, version, clock())))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, if there is one, which has all commits already; further changes are refused.

        Conditions are cancelled with their timers and waiting coroutines, watches end, and sources are closed. Closing
        it again has no effect.
        """
        with self._lock:
            self._closed = True
            conditions, watches = self._installed.conditions(), list(self._watches)
        for condition in conditions:
            condition.cancel()
        for one in watches:
            one.close()
        for source in self.sources():
            source.close()
        with self._lock.changing():
            self._history.close()

    def refresh(self) -> int:
        """Apply the new commits of the writer to a store that is opened `read_only` (S4.10); return the version.

        Subscribers, watches and installed conditions receive the changes in order, as if they were made here.

        Raises:
            ConflictError: this one is not opened `read_only`, or this thread is inside a transaction.
            HistoryError: the writer has compacted some of these changes; open the store again.
            StoreError: the file cannot be read, or the writer has extended the schema; open the store again.
        """
        with self._lock.changing():
            self._require_free()
            for change in self._history.later(self._version):
                self._time = change.time
                self._take_in(change)
        self._notifier.deliver()
        return self._version

    @contextmanager
    def transaction(
        self, author: str, *, expect: int | None = None, key: str | None = None, along: Writer | None = None
    ) -> Iterator[Transaction]:
        """Make several changes as one: committed when the block ends, dropped when it raises.

        Questions of other threads continue meanwhile; their changes wait for the end of the block. A block with a `key`
        that was committed before runs, but changes nothing: its transaction has the first `change` from the beginning.

        Args:
            author: the author of the change.
            expect: the version that the world must have at the beginning.
            key: an idempotency key: a name of this change that recognises a repetition, also after a restart.
            along: writes more rows into the store's file in the same SQLite transaction.

        Raises:
            ConflictError: the version is not the expected one, or this thread is inside another transaction.
            StoreError: the file cannot be written, or the knowledge base is closed; nothing was changed.
        """
        _require_names(author, key)
        try:
            with self._lock.alone():
                self._require_free()
                first = self._first(key, expect)
                transaction = Transaction(Overlay(self._state), self._questions, first)
                self._writer = (get_ident(), author)
                self._notifier.quiet = True
                try:
                    yield transaction
                finally:
                    self._writer, self._notifier.quiet = None, False
                    transaction.close()
                if first is None:
                    with self._lock:
                        transaction.change = self._commit(transaction.delta, author, key, along)
        finally:
            self._notifier.deliver()

    def apply(
        self,
        delta: Delta,
        author: str,
        *,
        expect: int | None = None,
        key: str | None = None,
        along: Writer | None = None,
    ) -> Change:
        """Commit `delta` as a whole; return its effective change.

        Arguments as for `transaction`; for a `key` that was committed before, return that change and change nothing.

        Raises:
            UnknownNameError: an undeclared type, predicate or function, or an unknown thing.
            SchemaError: a wrong number of arguments or a wrong type.
            InputError: a number that is not finite.
            ConflictError: the version is not the expected one, or this thread is inside a transaction.
            StoreError: the file cannot be written, or the knowledge base is closed; nothing was changed.
        """
        require_delta(delta)
        _require_names(author, key)
        with self._lock.changing():
            self._require_free()
            change = self._first(key, expect)
            if change is None:
                pending = Overlay(self._state)
                pending.apply(delta)
                change = self._commit(pending.delta, author, key, along)
        self._notifier.deliver()
        return change

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Write the commits inside a block to the file as one transaction, together with the block's own rows.

        Each commit is a separate version and is announced immediately; it lasts only after the block. Changes of other
        threads, and their questions about the past, wait until then.

        Returns:
            A context manager with the connection; its user neither commits nor rolls back. Its entry or exit raises
            the errors.

        Raises:
            StoreError: there is no file, or it cannot be written. The memory is then ahead of the file: every further
                change is refused, and the file, opened again, has the state before the block.
            ConflictError: this thread is inside a transaction, or the store is opened `read_only`.
        """
        return GroupCommit(self._lock, self._require_free, self._history)

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every committed change from now on; the function returned ends that.

        Changes come in commit order; a commit without effect is not announced. A listener may query and change the
        knowledge base. If listeners raise, the committing call raises an `ExceptionGroup` after all calls; the change
        stays.
        """
        return self._notifier.subscribe(listener)

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

        The cost of an update depends on its change, see `conditions.join`. A condition that is true already does not
        fire; its hold time begins.

        Args:
            text: a condition; it is true if there are values for its free variables, which then are its witness.
            params: variables with a given value.
            fire: `edge`, when it becomes true; `each`, also at every change of the set of its witnesses while
                it is true.
            hold_s: time in seconds for which it must stay true before it fires.
            once: its first firing cancels it.
            hysteresis: margin by which its comparisons must fail before it is false: `(> (level) 9)` becomes true
                above 9, and false when `(> (level) (- 9 hysteresis))` is false.
            clock: measures `hold_s`.

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
        self._notifier.deliver()
        return condition

    def watch(
        self, pattern: str | Expression | None = None, params: Mapping[str, Value] | None = None, *, limit: int = 1000
    ) -> Watch:
        """Watch the commits from now on that touch `pattern`, as an asynchronous iterator.

        If `limit` changes wait for the reader and another one comes, all are dropped; the next item is a `Missed`.

        Args:
            pattern: a predicate, function or type with arguments, e.g. `(on ?o table)`; `None` for all changes.
            params: variables of the pattern with a given value.
            limit: number of changes that may wait, at least 1.

        Raises:
            InputError: the pattern is not a pattern, or has an undeclared name.
            StoreError: the knowledge base is closed.
        """
        with self._lock:
            self._require_open()
            made = Watch(pattern, {} if params is None else params, self.schema, self._version, limit)
            made.follow(self.subscribe(made.hear))
            self._watches.add(made)
            return made

    def bind_source(self, function: str, *args: Value, reference: str) -> DataSource:
        """Let a source feed a function: `kb.bind_source("pose", "cup1", "map", reference="tf:map/cup1")`.

        Questions, snapshots and installed conditions see its latest value; versions, changes, watches, past worlds and
        JSON do not. Before the first update and after closing, the function has the value that was set. It cannot be
        set meanwhile. The removal of a thing closes the sources about it.

        Args:
            function: its name.
            args: its arguments.
            reference: the origin of the values, in the provider's words.

        Raises:
            UnknownNameError: an undeclared function, or an unknown thing.
            SchemaError: a wrong number of arguments, a wrong type, or there is a source for it already.
            InputError: the reference is empty.
            ConflictError: this thread is inside a transaction or a question.
            StoreError: the knowledge base is closed.
        """
        with self._lock.changing():
            self._require_free()
            return self._sources.bind(Fact(function, args), reference)

    def sources(self) -> list[DataSource]:
        """Return the open sources in the order in which they were bound."""
        return self._sources.listed()

    def at(self, *, version: int | None = None, time: float | None = None) -> View:
        """Return a view of a past world.

        Args:
            version: number of changes before.
            time: time in seconds of the clock; changes at that very time count.

        Raises:
            HistoryError: it is no longer kept (`compact`; memory keeps the last 10,000 changed things, facts and
                numbers), or it is in the future.
            InputError: not exactly one of the two is given, or it is neither a version nor a time.
        """
        if (version is None) == (time is None):
            raise InputError("at(...) takes a version or a time")
        if version is None:
            require_time(time)
        with self._lock.alone():
            if version is None:
                version = min(self._history.version_at(float(time or 0.0)), self._version)
            self._require_reached(version)
            return View(self._history.state(version, self._present), version)

    @property
    def oldest(self) -> int:
        """The first version that is still kept, for `at` and `changes`."""
        return self._history.oldest()

    def changes(self, since: int = 0, until: int | None = None) -> list[Change]:
        """Return the changes after version `since` up to version `until` (default: all).

        Raises:
            HistoryError: some of them are no longer kept, or are in the future.
            InputError: one of the two is not a version, or `until` is before `since`.
        """
        with self._lock.alone():
            self._require_reached(since)
            until = self._version if until is None else until
            self._require_reached(until)
            if until < since:
                raise InputError(f"changes are read from a version up to a later one, not from {since} to {until}")
            return self._history.changes(since, until)

    @property
    def digest(self) -> bytes:
        """Digest of the newest version in the store's file, which covers all versions before it; empty in memory."""
        return self._history.digest

    def compact(self, keep_since: int | None = None) -> None:
        """Forget the versions before `keep_since` (default: the present one); idempotency keys stay.

        Raises:
            HistoryError: that version is no longer kept, or in the future.
            InputError: it is not a version.
            StoreError: the file cannot be written, or the knowledge base is closed.
        """
        with self._lock.changing():
            self._require_open()
            version = self._version if keep_since is None else keep_since
            self._require_reached(version)
            self._history.compact(version, self._present)

    def _first(self, key: str | None, expect: int | None) -> Change | None:
        """Return the change that was committed under `key`; a new one must meet the expected version."""
        first = None if key is None else self._history.first(key)
        if first is None and expect is not None and expect != self._version:
            raise ConflictError(f"version {expect} is expected, but the world is at version {self._version}")
        return first

    def _commit(self, effective: Delta, author: str, key: str | None, along: Writer | None) -> Change:
        self._require_open()  # the block of a transaction may have closed it
        self._time = max(self._time, self._clock())
        change = Change(self._version + bool(effective), author, effective, self._time)
        self._history.append(change, key, self._state, along)
        if effective:
            self._take_in(change)
        return change

    def _take_in(self, change: Change) -> None:
        """Make a change that the history keeps, and queue the notifications."""
        effective = change.delta
        departures = self._installed.departures(effective) if effective.removed_nodes else []
        if effective.removed_nodes:
            self._sources.close_about(effective.removed_nodes)
        self._state.commit(effective)
        if self._graph is not None:
            self._graph.commit(effective)
        self._version = change.version
        self._notifier.add(change)
        self._installed.commit(effective, departures)

    def _present(self) -> Version:
        with self._lock:
            return Version(self._state.copy(), self._version, self._time)

    def _require_reached(self, version: int) -> None:
        require_version(version)
        if version < 0:
            raise gone(version, self.oldest)
        if version > self._version:
            raise HistoryError(f"version {version} is in the future; the newest is {self._version}")

    def _require_open(self) -> None:
        if self._closed:
            raise StoreError("the knowledge base is closed; it only answers questions")

    def _require_free(self) -> None:
        self._require_open()
        if self._writer is not None and self._writer[0] == get_ident():
            raise ConflictError(f"a transaction by '{self._writer[1]}' is open in this thread already")


def _resolved(path: object) -> Path:
    if not isinstance(path, str | Path) or "\0" in str(path) or not str(path):
        raise InputError(f"a store's path is text or a Path, not {shown(path)}")
    return located(path)


def _require_names(author: object, key: object) -> None:
    require_text(author, "an author")
    if key is not None:
        require_text(key, "a key")
