"""The knowledge base: one consistent world model for all who ask, change and listen (S4.2, S4.3)."""

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
    """A world model that may be asked and changed from several threads.

    One lock orders questions and changes by arrival (`world.read_write_lock`). A question sees one version and its
    answer is a finished list. A change is made as a whole or, with an error, not at all. Listeners are called when the
    lock is released.

    Made like this it is in memory only and remembers its last changes; `open` makes one that lasts.

    Args:
        schema: what may be said.
        clock: gives the time of changes, in seconds.
        history: what it goes on from and where its changes are kept; the schema is that of the history then.
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
        """A knowledge base in memory, or one that lasts in a file; close it, or use it in a `with` block.

        Args:
            schema: what may be said; for a file that is there already `None` takes what it was written with,
                and an extension of that (more declarations, none changed) is accepted and recorded.
            path: the store's file, made when nothing is there; `None` keeps everything in memory.
            durability: what a committed change outlives: "memory" nothing (without a path), "process" the
                death of this process by whatever means (the default with a path), "power" a power cut too.
            clock: gives the time of changes, in seconds.
            read_only: look at a store that another process may be writing; `refresh` follows it.
            new: the file must not be there yet.

        Raises:
            StoreError: the file cannot be read or written, is no store, or somebody else is writing it; or a file
                beside it has a name of the store's and is none of it. All files are as before.
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
            raise InputError("a store that is opened read_only is there already, and not new")
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
        """What `to_json` wrote, from its text or a file (a `Path`), at the same version, in memory.

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
        """Give back the file, if there is one; nothing can be changed then. What was committed is in it already.

        Installed conditions are cancelled, so that no timer goes on and whoever waits for one is told; watches
        end and sources are closed. Repeating it is fine.
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
        """Take in what the writer of a store that is opened `read_only` has committed meanwhile (S4.10).

        The changes are announced in order, as if they were made here, to subscribers, watches and installed
        conditions. Returns the version reached.

        Raises:
            ConflictError: this one is not opened `read_only`, or this thread is inside a transaction.
            HistoryError: the writer has compacted what was not taken in yet; open the store anew.
            StoreError: the file cannot be read, or the writer has a longer schema now; likewise.
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
        """Several changes as one: committed when the block ends, dropped when it raises.

        Other threads ask meanwhile; a thread that changes something waits until the block is left. A block with a
        `key` that was committed before runs, but changes nothing: its transaction has the first one's `change` from
        the beginning.

        Args:
            author: who changes it.
            expect: the version that the world must have at the beginning.
            key: a name for this change, by which a repetition is known, also after a restart.
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
        """Commit `delta` as a whole; the change returned holds what really became different.

        Arguments as for `transaction`; with a `key` that was committed before, that change is returned and
        nothing is changed.

        Raises:
            UnknownNameError: an undeclared type, predicate or function, or a thing that is not there.
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
        """What is committed inside the block is written to the file as one, together with what the block itself writes.

        Each change is a version of its own, and is seen and announced at once, as always; nobody may count on
        it before the block is left. Other threads that change something, or ask for the past, wait until then.

        Returns:
            What gives the block the connection; whoever writes with it neither commits nor rolls back. Entering or
            leaving it raises the errors.

        Raises:
            StoreError: there is no file, or it cannot be written. What is in memory is then ahead of it: every
                further change is refused, and the file, opened anew, has what was before the block.
            ConflictError: this thread is inside a transaction, or the store is opened `read_only`.
        """
        return GroupCommit(self._lock, self._require_free, self._history)

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every committed change from now on; the function returned ends that.

        Changes come in commit order; a commit that changes nothing is not announced. A listener may ask and
        change the knowledge base. When listeners raise, the committing call raises an `ExceptionGroup`
        after all have been told; the change stays.
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

        What an update costs depends on what it changes, see `conditions.join`. What is true already does
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
        self._notifier.deliver()
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
            made = Watch(pattern, {} if params is None else params, self.schema, self._version, limit)
            made.follow(self.subscribe(made.hear))
            self._watches.add(made)
            return made

    def bind_source(self, function: str, *args: Value, reference: str) -> DataSource:
        """Let a function be fed from outside: `kb.bind_source("pose", "cup1", "map", reference="tf:map/cup1")`.

        Its latest value is what questions, snapshots and installed conditions see; versions, changes, watches,
        past worlds and JSON do not have it. Until the first update and after closing the function reads as if
        it were not bound; meanwhile it cannot be set. Removing a thing closes the sources about it.

        Args:
            function: its name.
            args: its arguments.
            reference: where the values come from, in words of whoever provides them.

        Raises:
            UnknownNameError: an undeclared function, or a thing that is not there.
            SchemaError: a wrong number of arguments, a wrong type, or there is a source for it already.
            InputError: the reference is empty.
            ConflictError: this thread is inside a transaction or a question.
            StoreError: the knowledge base is closed.
        """
        with self._lock.changing():
            self._require_free()
            return self._sources.bind(Fact(function, args), reference)

    def sources(self) -> list[DataSource]:
        """The sources that are open, in the order in which they were bound."""
        return self._sources.listed()

    def at(self, *, version: int | None = None, time: float | None = None) -> View:
        """The world as it was, to be asked like this one.

        Args:
            version: after so many changes.
            time: in seconds of the clock; what was changed at that very time counts.

        Raises:
            HistoryError: that is not kept any more (`compact`; in memory the last 10,000 things, facts and
                numbers changed are kept), or it is not there yet.
            InputError: not exactly one of the two is given, or it is no version or no time.
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
        """The first version that can still be asked for (`at`), and since which changes are known."""
        return self._history.oldest()

    def changes(self, since: int = 0, until: int | None = None) -> list[Change]:
        """The changes after version `since`, up to that which made version `until` (default: all).

        Raises:
            HistoryError: some of them are not kept any more, or are not there yet.
            InputError: one of the two is no version, or `until` is before `since`.
        """
        with self._lock.alone():
            self._require_reached(since)
            until = self._version if until is None else until
            self._require_reached(until)
            if until < since:
                said = f"changes are told from a version on until a later one, not from {since} until {until}"
                raise InputError(said)
            return self._history.changes(since, until)

    @property
    def digest(self) -> bytes:
        """Of the newest version in the store's file and of everything before it; empty in memory."""
        return self._history.digest

    def compact(self, keep_since: int | None = None) -> None:
        """Forget what only versions before `keep_since` need (default: the present one); keys are remembered.

        Raises:
            HistoryError: that version is not kept any more or not there yet.
            InputError: it is no version.
            StoreError: the file cannot be written, or the knowledge base is closed.
        """
        with self._lock.changing():
            self._require_open()
            version = self._version if keep_since is None else keep_since
            self._require_reached(version)
            self._history.compact(version, self._present)

    def _first(self, key: str | None, expect: int | None) -> Change | None:
        """The change that `key` stands for already; only a new one must meet the expected version."""
        first = None if key is None else self._history.first(key)
        if first is None and expect is not None and expect != self._version:
            raise ConflictError(f"version {expect} is expected, but the world is at version {self._version}")
        return first

    def _commit(self, effective: Delta, author: str, key: str | None, along: Writer | None) -> Change:
        self._require_open()  # a transaction's own block may have closed it
        self._time = max(self._time, self._clock())
        change = Change(self._version + bool(effective), author, effective, self._time)
        self._history.append(change, key, self._state, along)
        if effective:
            self._take_in(change)
        return change

    def _take_in(self, change: Change) -> None:
        """The change is kept; make it, and queue what others have to be told."""
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
            raise HistoryError(f"version {version} is not there yet; the newest is {self._version}")

    def _require_open(self) -> None:
        if self._closed:
            raise StoreError("the knowledge base is closed; it can only be asked")

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
