"""Store of a run in the file of its knowledge: one transaction per macrostep, with every value that a restart needs.

`RunWriter` provides the transactions, a fence against a second writer, and listeners at the boundaries of transactions.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, Literal

from dsc.dynamic.experience import NO_EXPERIENCE
from dsc.dynamic.library import Library
from dsc.engine.steps import Output, SendMessage, Start
from dsc.messages import LateMessage, Message, Told
from dsc.runs.archive import RELATIONS, RunArchive, archive, unfinished
from dsc.runs.encoding import SKILLS, message_form, signature_forms
from dsc.runs.hashed_forms import Shortener
from dsc.runs.kept import EXPERIENCE, Kept, read, require_unchanged
from dsc.runs.state import ReactorState, RunState
from dsc.runs.tables import CHAIN, FORMAT, TABLES, require_tables_of_runs
from dsc.skills import SkillSignature
from dsc.trace import Record, text_of
from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.integrity import NOTHING, Tip, link, put_ends
from knowledge_base.store import KnowledgeBase

WHOLE_EVERY = 256
"""Number of macrosteps from one that writes the whole state to the next; a restart reads at most this number."""
_RIGHT = "SELECT 1 FROM fence WHERE epoch = ?"
_STEP = "INSERT INTO steps SELECT NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ? FROM fence WHERE epoch = ?"
_LAST = """SELECT run, number, time, before, version, serials, message, configuration, change, records, knowledge,
    place FROM steps ORDER BY place DESC LIMIT 1"""
_BEFORE = """SELECT digest FROM steps WHERE place = ? AND run = ?
    UNION ALL SELECT digest FROM runs WHERE run = ? LIMIT 1"""
_MORE = """UPDATE steps SET change = change || ?, records = records || ?, digest = ?
    WHERE place = (SELECT max(place) FROM steps)"""
_SEAL = "SELECT run, seal FROM runs ORDER BY run DESC LIMIT 1"
_BEGIN = """INSERT INTO runs (run, plot, arguments, version, header, plots, domain, digest)
    VALUES (?, ?, ?, ?, ?, ?, ?, ?)"""
_END = "UPDATE runs SET ended = ?, steps = ?, seal = ? WHERE run = ?"
Boundary = Literal["before commit", "after commit"]
"""Points at which a crash makes a difference.

Before the commit, nothing of the macrostep is stored. After the commit, none of its actions is dispatched yet.
"""


class RunWriter:
    """Context manager for consecutive transactions; a new writer revokes the right of all earlier writers.

    Args:
        knowledge: the knowledge base of the run, opened at `path`.
        path: the file of the knowledge base.

    Attributes:
        connection: the connection for writes inside the block. Call `require_right` before writes other than a
            macrostep.
        before: version of the knowledge when the transaction began.
        begun: whether a transaction was committed.
        lost: whether a write failed, so that memory has changes that the file lacks.

    Raises:
        StoreError: the file cannot be written, at the beginning or the end of the block.
    """

    def __init__(self, knowledge: KnowledgeBase, path: Path) -> None:
        self.begun = self.lost = False
        self.before = 0
        self._digest = NOTHING
        self._last: tuple[bytes, tuple[Any, ...]] = NOTHING, ()
        self._knowledge = knowledge
        self._path = path
        self._listeners: list[Callable[[Boundary], None]] = []
        self._together = knowledge.together()
        with self._together as self.connection:
            self._cursor = self.connection.cursor()  # `Connection.execute` creates one at each call
            if not require_tables_of_runs(self.connection, path):
                for statement in TABLES.values():
                    self.connection.execute(statement)
                put_ends(self.connection, [(CHAIN, Tip(0, NOTHING))])
            (epoch,) = self.connection.execute("SELECT max(epoch) FROM fence").fetchone()
            self.connection.execute("DELETE FROM fence")
            self._epoch = (epoch or 0) + 1
            self.connection.execute("INSERT INTO fence VALUES (?, ?)", (self._epoch, FORMAT))

    def listen(self, listener: Callable[[Boundary], None]) -> None:
        """Call `listener` before and after each later commit."""
        self._listeners.append(listener)

    def __enter__(self) -> None:
        try:
            self.connection = self._together.__enter__()
        except BaseException:
            self.lost = True
            raise
        self.before = self._knowledge.version

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            if error is None:
                for listener in self._listeners:
                    listener("before commit")
        except BaseException as stopped:
            self._close(stopped)
            raise
        self._close(error)
        if error is None:
            self.begun = True
            for listener in self._listeners:
                listener("after commit")

    def require_right(self) -> None:
        """Raise `StoreError` if another sequencer owns the run."""
        if self.connection.execute(_RIGHT, (self._epoch,)).fetchone() is None:
            raise self._taken_over()

    def begin(self, *row: Any) -> int:
        """Write the row of a run without its number, and return the number; errors equal those of `require_right`."""
        self.require_right()
        last, seal = self.connection.execute(_SEAL).fetchone() or (0, NOTHING)
        self._digest = link(seal, last + 1, *row)
        self.connection.execute(_BEGIN, (last + 1, *row, self._digest))
        put_ends(self.connection, [(CHAIN, None)])
        return int(last) + 1

    def step(self, *row: Any) -> None:
        """Write the row of a macrostep without its place; check the right, with the errors of `require_right`."""
        knowledge = self._knowledge.digest
        before = (self._digest or self._find_digest()) + knowledge
        digest = link(before, *row)
        if self._cursor.execute(_STEP, (*row, knowledge, digest, self._epoch)).rowcount != 1:
            raise self._taken_over()
        self._last = before, row
        self._digest = digest

    def more(self, change: str = "", records: str = "") -> None:
        """Append to the row of the last macrostep; errors equal those of `require_right`."""
        self.require_right()
        self._digest = self._digest or self._find_digest()
        before, row = self._last
        row = *row[:-2], row[-2] + change, row[-1] + records
        self._digest = link(before, *row)
        self.connection.execute(_MORE, (change, records, self._digest))
        self._last = before, row

    def end(self, run: int, ended: str, records: str) -> None:
        """Write the end of a run, with the last records; errors equal those of `require_right`."""
        self.more(records=records)
        (steps,) = self.connection.execute("SELECT max(place) FROM steps").fetchone()
        seal = link(self._digest, steps, ended)
        self.connection.execute(_END, (ended, steps, seal, run))
        put_ends(self.connection, [(CHAIN, Tip(steps, seal))])

    def _find_digest(self) -> bytes:
        """Return the digest of the last macrostep, which an earlier process has written."""
        *row, knowledge, place = self.connection.execute(_LAST).fetchone()
        (before,) = self.connection.execute(_BEFORE, (place - 1, row[0], row[0])).fetchone()
        self._last = before + knowledge, tuple(row)
        return link(before + knowledge, *row)

    def _taken_over(self) -> StoreError:
        return StoreError("another sequencer has taken this run over", place=Place(str(self._path)))

    def _close(self, error: BaseException | None) -> None:
        self.lost = self.lost or error is not None
        try:
            self._together.__exit__(None if error is None else type(error), error, None)
        except BaseException:
            self.lost = True
            raise


class RunStore:
    """Store of one run of one sequencer; call the writing methods inside `with store.writing`.

    Args:
        knowledge: the knowledge base of the run, opened at `path`.
        path: the file of the knowledge base.
        header: plain data of the run's program.
        domain: other definitions that plots depend on, as text by name ("planning action 'go'").

    Attributes:
        writing: one transaction, `with store.writing`, for the knowledge and for the methods below.
        receive: receives a record of the trace, which is written with the next macrostep.
        last_late: the highest number of a pending `LateMessage`.

    Raises:
        StoreError: the file cannot be written.
    """

    def __init__(
        self,
        knowledge: KnowledgeBase,
        path: Path,
        header: Mapping[str, Any] | None = None,
        domain: Mapping[str, str] | None = None,
    ) -> None:
        self.path = path
        self.writing = RunWriter(knowledge, path)
        self.last_late = 0
        self._knowledge = knowledge
        self._header = header or {}
        self._domain = domain or {}
        self._run = self._number = 0
        self._records: list[Record] = []
        self.receive: Callable[[Record], None] = self._records.append
        self._short = Shortener(self._put_form)
        self._state = RunState(self._short)

    @property
    def begun(self) -> bool:
        """Whether this store has begun or resumed a run."""
        return self.writing.begun

    @property
    def lost(self) -> bool:
        """Whether a write failed, so that memory has changes that the file lacks."""
        return self.writing.lost

    def begin(
        self,
        plot: str,
        arguments: Mapping[str, Any],
        library: Library,
        skills: Iterable[SkillSignature] | None = None,
    ) -> int:
        """Begin a new run with the present knowledge.

        Args:
            plot: the plot's name.
            arguments: values of the plot's parameters.
            library: the plots.
            skills: the deployed skills, which a replay needs; `None` if more may be deployed.

        Returns:
            The last serial number that earlier runs have used.

        Raises:
            StoreError: another run is unfinished, or the file cannot be written.
        """
        self.writing.require_right()
        (open_runs,) = self.writing.connection.execute("SELECT count(*) FROM runs WHERE ended IS NULL").fetchone()
        if open_runs:
            choices = "`Robot.resume_or_start`, or `dsc run --resume`; `Robot.discard` or `dsc runs end` ends it"
            said = f"the store has an unfinished run, which can be resumed: {choices}"
            raise StoreError(said, place=Place(str(self.path)))
        self._number, self._state = 0, RunState(self._short)
        plots = {one.name: self._short.hash(one.to_form()) for one in library}
        deployed = {} if skills is None else {SKILLS: self._short.reference(signature_forms(skills))}
        if library.experience != NO_EXPERIENCE:
            form = library.experience.to_form()
            deployed[EXPERIENCE] = self._short.reference(form) if form["tries"] else form
        row = (
            plot, text_of(self._short(arguments)), self._knowledge.version, text_of({**self._header, **deployed}),
            text_of(plots), text_of(self._domain),
        )  # fmt: skip
        earlier = RunArchive(self.writing.connection, self.path, latest=True)
        serials = earlier.serials_before(max((one.number for one in earlier.runs()), default=0) + 1)
        self._run = self.writing.begin(*row)
        return serials

    def late(self, late: LateMessage, due: float) -> None:
        """Store a message from outside that is scheduled for second `due` of run time."""
        self._state.put(late, self._number, due)
        if self._number:  # else the first macrostep writes the change
            self.writing.more(change=self._state.change())

    def wait(self, start: Start, turn: float | None = None) -> None:
        """Store that an action waits for its component, or has waited and got its turn at second `turn`."""
        self._state.wait(start, turn)
        self.writing.more(change=self._state.change())

    def step(
        self,
        now: float,
        message: Message | None,
        output: Iterable[Output],
        reactor: ReactorState,
        undelivered: Collection[Told] = (),
        refused: Collection[Told] = (),
        memories: Iterable[tuple[str, Any]] = (),
        relations: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Write a macrostep.

        Args:
            now: second of run time.
            message: the handled message; `None` for entering and for leaving the plot.
            output: the macrostep's actions, which are dispatched after the commit.
            reactor: the reactor's state after the macrostep.
            undelivered: earlier commands that components have neither received nor refused yet.
            refused: earlier commands that components refused.
            memories: memories of components, by component name.
            relations: rows of relations that the macrostep has read, see `StepRow`.
        """
        self._number += 1
        form = {} if message is None else message_form(message, self._short)
        if relations:
            form[RELATIONS] = relations
        state, version = reactor.machine.state, self._knowledge.version
        self._state.dispatched(undelivered, refused)
        if message is not None:
            self._state.take(message)
        self._state.ask(output, self._number, now, reactor)
        self._state.update(reactor)
        self._state.remember(memories)
        change = self._state.change(whole=self._number % WHOLE_EVERY == 1)
        self.writing.step(
            self._run, self._number, float(now), self.writing.before, version, state.serials, text_of(form),
            _paths_text(state.configuration()), change, self._new_records(),
        )  # fmt: skip
        self.writing.before = version  # the next macrostep may be part of this transaction

    def suspend(self, messages: Iterable[SendMessage], now: float) -> None:
        """Store the messages that a resume has to send, at second `now` of run time."""
        self._state.suspend(messages, self._number, now)
        self.writing.more(change=self._state.change())

    def end(self, reactor: ReactorState) -> None:
        """Write the end of the run."""
        ended = {
            "finished": reactor.finished, "problem": reactor.problem,
            "programming_error": reactor.programming_error, "outputs": dict(reactor.outputs),
        }  # fmt: skip
        self.writing.end(self._run, text_of(ended), self._new_records())

    def discard(self, reason: str) -> None:
        """Write the end of the unfinished run, which was never resumed; call this method outside of `writing`.

        Raises:
            StoreError: there is no unfinished run, or the file cannot be written.
        """
        with archive(self.path, again=True, latest=True) as runs:
            run = unfinished(runs)
        ended = {"finished": False, "problem": reason, "programming_error": None, "outputs": {}}
        with self.writing:
            self.writing.end(run.number, text_of(ended), "")

    def load_unfinished(self, library: Library) -> Kept:
        """Load the unfinished run, to be resumed; call this method outside of `writing`.

        Raises:
            StoreError: there is no unfinished run, or it cannot be read.
            ChangedError: the plots or the domain differ from those with which the run began.
        """
        with archive(self.path, again=True, latest=True) as runs:  # opening the knowledge has checked the pages
            run = unfinished(runs)
            require_unchanged(runs, run, library, self._domain)
            kept = read(runs, run, library)
        self.writing.begun = True
        self._run, self._number = run.number, kept.number
        self._state.restore(kept)
        late = [one.what.number for one in kept.pending if isinstance(one.what, LateMessage)]
        self.last_late = max(late, default=0)
        return kept

    def _new_records(self) -> str:
        """Return the lines of the records since the last call."""
        lines = [record.to_line() for record in self._records]
        self._records.clear()
        return "\n".join(lines) + "\n" if lines else ""

    def _put_form(self, digest: str, text: str) -> None:
        self.writing.connection.execute("INSERT OR IGNORE INTO forms VALUES (?, ?)", (digest, text))


@lru_cache(maxsize=256)
def _paths_text(configuration: tuple[str, ...]) -> str:
    """Return the paths as text; cached, as most runs return to a few configurations."""
    return text_of(configuration)
