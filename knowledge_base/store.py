"""Knowledge base: one consistent world model for queries, changes and listeners (S4.2, S4.3)."""

from __future__ import annotations

import sqlite3
import time as wall
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from threading import get_ident
from types import TracebackType
from typing import TYPE_CHECKING, Self, get_args
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
from knowledge_base.language.checking.inputs import require_delta, require_text, require_time, require_version
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.sexpr import read
from knowledge_base.live_relations import LiveRelations
from knowledge_base.live_transforms import LiveTransforms
from knowledge_base.sources import DataSource, SourceListener, Sources
from knowledge_base.statements import told
from knowledge_base.transaction import GroupCommit, Transaction
from knowledge_base.user_objects import shown
from knowledge_base.view import View
from knowledge_base.world.live_rows import LiveRows, Rows
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

if TYPE_CHECKING:  # loads scipy
    from knowledge_base.transforms.tree import TransformTree

Now = Callable[[], float]
"""A function that returns the present time in seconds."""


class KnowledgeBase(View):
    """A world model that several threads may query and change.

    One lock admits queries and changes in the order of their arrival (`world.read_write_lock`). A query reads one
    version and returns a complete list. A change is applied as a whole, or raises an error and has no effect. Listeners
    are called after the lock is released.

    The constructor creates a knowledge base in memory, which keeps only its latest changes; `open` creates or opens one
    in a file.

    Args:
        schema: the declared types, constants, predicates and functions.
        clock: returns the time of a change, in seconds.
        history: the earlier versions; stores every change, and its schema replaces `schema`. The default keeps the
            latest changes in memory.
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
        self._relations = LiveRelations(start.state, self._installed, self._notifier)
        self._transforms = LiveTransforms(start.state, self._installed, self._notifier, self._relations.announce)
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
        """Open a knowledge base in memory or in a file.

        The caller must close the knowledge base, or use the knowledge base in a `with` block.

        Args:
            schema: the declarations; `None` uses the schema of the file. An extension of the file's schema (more
                declarations, none changed) replaces the file's schema.
            path: the store's file, which is created if it is missing; `None` keeps the knowledge base in memory.
            durability: the failure that a commit survives. "process" is the end of this process (default with a path);
                "power" also includes a power cut; "memory" is none (only without a path).
            clock: returns the time of a change, in seconds.
            read_only: open a store that another process may write; `refresh` applies the changes of that process.
            new: require that the file does not exist yet.

        Raises:
            StoreError: the file cannot be read or written, is not a store, or has another writer. The error is also
                raised for a foreign file with the name of a sidecar file. All files stay unchanged.
            SchemaMismatchError: `schema` does not extend the schema of the file.
            InputError: no schema is available, or the arguments contradict each other.
        """
        if not (schema is None or isinstance(schema, Schema)):
            raise InputError(f"a schema is a Schema, not {shown(schema)}; Schema.parse reads its text")
        if durability not in (None, *(valid := get_args(Durability))):
            raise InputError(f"there is no durability {shown(durability)}", found=durability, valid=valid)
        if path is None:
            if schema is None or durability not in (None, "memory") or read_only or new:
                raise InputError("a knowledge base without a file has a schema and durability 'memory'")
            return cls(schema, clock)
        if durability == "memory":
            raise InputError(f"with the file '{path}' durability is 'process' or 'power', not 'memory'")
        if read_only and new:
            raise InputError("a store that is opened read_only exists already, and is not new")
        file = located(path)
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
        """Read the output of `to_json` into memory and keep its version number.

        `text_or_path` is the JSON text, or a `Path` of its file. `source` is the name of the text in error messages.
        `apply(KnowledgeBase.from_json(path).contents(), author)` adds that world to another knowledge base.

        Raises:
            InputError: as for `exchange.read_json`.
        """
        state, version = read_json(text_or_path, schema, source)
        return cls(state.schema, clock, MemoryHistory(Version(state, version, clock())))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the knowledge base and its file; every later change raises `StoreError`.

        The file contains all commits already. All conditions are cancelled, with their timers and waiting coroutines.
        All watches and bindings of trees end, and all sources are closed. A second call has no effect.
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
        self._transforms.close()
        with self._lock.changing():
            self._history.close()

    def refresh(self) -> int:
        """Apply the writer's new commits to a store that is opened `read_only` (S4.10); return the new version.

        Subscribers, watches and installed conditions receive the changes in order, as for changes of this process.

        Raises:
            ConflictError: the store is not opened `read_only`, or this thread has an open transaction.
            HistoryError: the writer has compacted some of the new commits; open the store again.
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
        """Commit the changes of a `with` block together at its end; discard the changes if the block raises.

        Queries of other threads continue during the block; changes of other threads wait for its end. If a change with
        the same `key` was committed before, the block runs without effect. `Transaction.change` is then that earlier
        change from the beginning.

        Args:
            author: the author of the change.
            expect: the version that the knowledge base must have at the beginning.
            key: an idempotency key: a name that identifies a repetition of this change, also after a restart.
            along: writes more rows into the store's file, in the SQLite transaction of this change.

        Raises:
            ConflictError: the version is not the expected one, or this thread has another open transaction.
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
        change: Delta | str,
        author: str,
        *,
        expect: int | None = None,
        key: str | None = None,
        along: Writer | None = None,
    ) -> Change:
        """Commit a change as a whole; return its effective change.

        The change is a `Delta`, or a text of statements: `(cup cup1) (on cup1 table) (not (clear table))`. Statements
        declare objects, make facts true or false, and set values; they read the present version.

        `transaction` describes the other arguments. If a change with the same `key` was committed before, return
        that change and change nothing.

        Raises:
            UnknownNameError: an undeclared type, predicate or function, or an unknown object.
            SchemaError: a wrong number of arguments or a wrong type.
            ParseError: the text contains something else than statements.
            InputError: a number that is not finite, or statements that contradict each other.
            ConflictError: the version is not the expected one, or this thread has an open transaction.
            StoreError: the file cannot be written, or the knowledge base is closed; nothing was changed.
        """
        if not isinstance(change, str):
            require_delta(change)
        _require_names(author, key)
        with self._lock.changing():
            self._require_free()
            done = self._first(key, expect)
            if done is None:
                pending = Overlay(self._state)
                pending.apply(told(read(change), self._state) if isinstance(change, str) else change)
                done = self._commit(pending.delta, author, key, along)
        self._notifier.deliver()
        return done

    def together(self) -> AbstractContextManager[sqlite3.Connection]:
        """Return a context manager that writes all commits of its block to the file in one transaction.

        The transaction includes the rows that the block itself writes.

        Each commit is a separate version and is announced immediately, but is durable only after the end of the block.
        Until then, changes of other threads wait, and so do their queries of past versions.

        Returns:
            A context manager whose value is the SQLite connection; the block must neither commit nor roll back. The
            errors below are raised on entry to or exit from the block.

        Raises:
            StoreError: no file exists, or the file cannot be written. In the second case the memory is ahead of the
                file, and every later change raises this error. The reopened file has the state before the block.
            ConflictError: this thread has an open transaction, or the store is opened `read_only`.
        """
        return GroupCommit(self._lock, self._require_free, self._history)

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every later committed change; return a function that ends the subscription.

        The listener receives changes in commit order; a commit without effect is not announced. A listener may query
        and change the knowledge base. If listeners raise, the committing call raises an `ExceptionGroup` after it has
        called all listeners; the change stays committed.
        """
        return self._notifier.subscribe(listener)

    def subscribe_to_sources(self, listener: SourceListener) -> Callable[[], None]:
        """Call `listener` with a source after each change of its value; return a function that ends the subscription.

        The calls come in the threads that update the sources. No version and no `Change` contains such a value.
        """
        return self._sources.subscribe(listener)

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
        """Evaluate a condition at every later version, and fire when it becomes true (S2.4).

        A condition that is true at its installation does not fire, but its hold time begins.

        Args:
            text: a condition; the values of its free variables that make it true are its witness.
            params: variables of the condition with a fixed value.
            fire: `edge` fires when the condition becomes true; `each` also at each change of its true witnesses.
            hold_s: time in seconds for which the condition must stay true before it fires.
            once: whether the first firing cancels the condition.
            hysteresis: margin by which the comparisons must fail before the condition is false.
            clock: measures `hold_s`.

        Raises:
            InputError: as for `query`; a hold time that is negative, not finite or without a clock; a hysteresis
                without a comparison; a value of `fire` other than `edge` and `each`.
            StoreError: the knowledge base is closed.
        """
        firing = terms(fire, hold_s=hold_s, once=once, clock=clock)
        with self._lock:
            self._require_open()
            params = self._questions.given(text, params, self._state, "answers")
            e = self.schema.expanded(self._questions.query(text, params, self._state))
            condition = self._installed.install(e, params, firing, hysteresis)
        self._notifier.deliver()
        return condition

    def conditions(self, *, cancelled: bool = False) -> list[Condition]:
        """Return the installed conditions in order, or the latest hundred cancelled ones (S2.19)."""
        with self._lock:
            return self._installed.conditions(cancelled=cancelled)

    def watch(
        self, pattern: str | Expression | None = None, params: Mapping[str, Value] | None = None, *, limit: int = 1000
    ) -> Watch:
        """Return an asynchronous iterator over the later commits that match `pattern`.

        If a change arrives while `limit` changes wait for the reader, the watch discards the new and the waiting
        changes; the next item is a `Missed`.

        Args:
            pattern: a predicate, function or type with arguments, e.g. `(on ?o table)`; `None` for all changes.
            params: variables of the pattern with a fixed value.
            limit: number of changes that may wait for the reader, at least 1.

        Raises:
            InputError: `pattern` is not a pattern, or contains an undeclared name.
            StoreError: the knowledge base is closed.
        """
        with self._lock:
            self._require_open()
            made = Watch(pattern, {} if params is None else params, self.schema, self._version, limit)
            made.follow(self.subscribe(made.receive))
            self._watches.add(made)
            return made

    def bind_source(self, function: str, *args: Value, reference: str) -> DataSource:
        """Bind a function to a source: `kb.bind_source("pose", "cup1", "map", reference="tf:map/cup1")`.

        Queries, snapshots and installed conditions use the latest value of the source. Versions, changes, watches, past
        worlds and JSON do not contain this value. Before the first update and after closing, the function has the value
        that a change has set. While the source is open, no change can set the function. The removal of an object closes
        the sources of its functions.

        Args:
            function: name of the function.
            args: arguments of the function.
            reference: the origin of the values, in the notation of the provider.

        Raises:
            UnknownNameError: an undeclared function, or an unknown object.
            SchemaError: a wrong number of arguments, a wrong type, or the function has an open source already.
            InputError: the reference is empty.
            ConflictError: this thread has an open transaction or is evaluating a query.
            StoreError: the knowledge base is closed.
        """
        with self._lock.changing():
            self._require_free()
            return self._sources.bind(Fact(function, args), reference)

    def bind_transforms(self, function: str, tree: TransformTree) -> Callable[[], None]:
        """Let a tree answer `(pose ?frame ?reference) - geometry` for all objects; return a function that ends this.

        Queries, snapshots and installed conditions read the latest pose, x y z qx qy qz qw, or `()` if there is none.
        A change of the function publishes a static transform to the tree, or removes its arc by `()`. No version, watch
        or file contains poses.

        Raises:
            UnknownNameError, SchemaError: the function is not such a function, or has a tree or a source already.
            StoreError: the knowledge base is closed.
        """
        self._require_open()
        return self._transforms.bind(function, tree)

    def subscribe_to_relations(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Call `listener` after each change of relations that were read; return a function that ends this.

        The calls come in the threads that renew relations.
        """
        return self._relations.subscribe(listener)

    def provide(self, rows: Mapping[str, Rows]) -> Callable[[], None]:
        """Provide the rows of declared relations, e.g. of a run; return a function that ends this.

        Queries and conditions read the rows; versions, changes, snapshots and past worlds do not contain them. Call
        `renew_relations` after a change of the rows.
        """
        return self._relations.provide(rows)

    @property
    def live_rows(self) -> LiveRows:
        """The rows of relations that programs provide."""
        return self._state.live

    def renew_relations(self, *names: str) -> bool:
        """Evaluate the installed conditions on relations whose rows have changed; return whether any was read.

        Args:
            names: the relations with other rows; by default all.

        Raises:
            ExceptionGroup: at least one listener raised an exception; all other listeners were called nevertheless.
        """
        return self._relations.renew(names or tuple(self.live_rows.read))

    def sources(self) -> list[DataSource]:
        """Return the open sources in the order of their binding."""
        return self._sources.listed()

    def at(self, *, version: int | None = None, time: float | None = None) -> View:
        """Return a view of a past version.

        Args:
            version: number of the version, which equals the number of changes before.
            time: time in seconds of the clock; the view includes changes at exactly this time.

        Raises:
            HistoryError: the version is in the future or no longer kept. `compact` removes versions; memory keeps the
                latest 10,000 changed objects, facts and numbers.
            InputError: not exactly one of `version` and `time` is given, or the value is not valid.
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
        """The oldest version that is still kept, for `at` and `changes`."""
        return self._history.oldest()

    def changes(self, since: int = 0, until: int | None = None) -> list[Change]:
        """Return the changes after version `since` up to and including version `until` (default: the newest).

        Raises:
            HistoryError: some of these changes are no longer kept, or are in the future.
            InputError: `since` or `until` is not a version, or `until` is before `since`.
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
        """Digest of the newest version in the store's file.

        The digest covers all versions before it; in memory the digest is empty.
        """
        return self._history.digest

    def compact(self, keep_since: int | None = None) -> None:
        """Discard the versions before `keep_since` (default: the present version); idempotency keys stay.

        Raises:
            HistoryError: version `keep_since` is no longer kept, or is in the future.
            InputError: `keep_since` is not a version.
            StoreError: the file cannot be written, or the knowledge base is closed.
        """
        with self._lock.changing():
            self._require_open()
            version = self._version if keep_since is None else keep_since
            self._require_reached(version)
            self._history.compact(version, self._present)

    def _first(self, key: str | None, expect: int | None) -> Change | None:
        """Return the change that was committed under `key`, or `None` for a new change.

        Raise `ConflictError` if a new change does not meet the version `expect`.
        """
        first = None if key is None else self._history.first(key)
        if first is None and expect is not None and expect != self._version:
            raise ConflictError(f"version {expect} is expected, but the world is at version {self._version}")
        return first

    def _commit(self, effective: Delta, author: str, key: str | None, along: Writer | None) -> Change:
        self._require_open()  # the block of a transaction may have closed the knowledge base
        if not (effective.values and self._state.poses):
            return self._store(effective, author, key, along)
        with self._transforms.publish(effective) as rest:
            return self._store(rest, author, key, along)

    def _store(self, effective: Delta, author: str, key: str | None, along: Writer | None) -> Change:
        self._time = max(self._time, self._clock())
        change = Change(self._version + bool(effective), author, effective, self._time)
        self._history.append(change, key, self._state, along)
        if effective:
            self._take_in(change)
        return change

    def _take_in(self, change: Change) -> None:
        """Apply a change that the history has stored, and queue the notifications."""
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
        if self._state.poses and (effective.nodes or effective.removed_nodes):
            self._transforms.reread()

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


def _require_names(author: object, key: object) -> None:
    require_text(author, "an author")
    if key is not None:
        require_text(key, "a key")
