"""A run in the file of its knowledge: one transaction a macrostep, with everything that a restart needs (S0.15)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from dsc.dynamic.library import Library
from dsc.engine.steps import Output
from dsc.messages import LateMessage, Message, Told
from dsc.runs.archive import RunArchive, archive, unfinished
from dsc.runs.design_changes import require_unchanged
from dsc.runs.encoding import Kept, Shortener, message_form
from dsc.runs.state import ReactorState, RunState, read
from dsc.runs.writer import RunWriter
from dsc.trace import Record, text_of
from knowledge_base.errors import Place, StoreError
from knowledge_base.store import KnowledgeBase

WHOLE_EVERY = 256
"""Macrosteps from one that writes the whole state to the next: a restart reads at most as many."""


class RunStore:
    """Keeps one run of one sequencer; methods that write are called inside `with store.writing`.

    Args:
        knowledge: the knowledge base of the run, opened at `path`.
        path: its file.
        header: plain data of the run's program.
        domain: other things that plots rely on, as text by name ("planning action 'go'").

    Attributes:
        writing: one transaction, `with store.writing`, for the knowledge and for the methods below.
        hear: takes a record of the trace, to be kept with the next macrostep.
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
        self.hear: Callable[[Record], None] = self._records.append
        self._short = Shortener(self._put_form)
        self._state = RunState(self._short)

    @property
    def begun(self) -> bool:
        """Whether a run is kept here."""
        return self.writing.begun

    @property
    def lost(self) -> bool:
        """Whether a write failed: memory is ahead of the file."""
        return self.writing.lost

    def begin(self, plot: str, arguments: Mapping[str, Any], library: Library) -> int:
        """Begin a new run with the present knowledge.

        Returns:
            The last serial number that earlier runs have given out.

        Raises:
            StoreError: another run is unfinished.
        """
        self.writing.require_right()
        (open_runs,) = self.writing.connection.execute("SELECT count(*) FROM runs WHERE ended IS NULL").fetchone()
        if open_runs:
            raise StoreError("the store has an unfinished run, which can be resumed", place=Place(str(self.path)))
        self._number, self._state = 0, RunState(self._short)
        plots = {one.name: self._short.hash(one.to_form()) for one in library}
        row = (
            plot, text_of(self._short(arguments)), self._knowledge.version, text_of(self._header), text_of(plots),
            text_of(self._domain),
        )  # fmt: skip
        earlier = RunArchive(self.writing.connection, self.path)
        serials = earlier.serials_before(len(earlier.runs()) + 1)
        self._run = self.writing.begin(*row)
        return serials

    def late(self, late: LateMessage, due: float) -> None:
        """Keep a message from outside that comes at second `due` of run time."""
        self._state.put(late, self._number, due)
        if self._number:  # else it goes with the first macrostep
            self.writing.more(change=self._state.change())

    def step(
        self,
        now: float,
        message: Message | None,
        output: Iterable[Output],
        reactor: ReactorState,
        under_way: Collection[Told] = (),
        refused: Collection[Told] = (),
        memories: Iterable[tuple[str, Any]] = (),
    ) -> None:
        """Keep a macrostep; `message` is `None` for the start of the plot and for leaving it.

        Args:
            now: second of run time.
            message: the message that it took.
            output: its actions, for after the commit.
            reactor: its state after the macrostep.
            under_way: earlier commands that components have not taken yet.
            refused: earlier commands that components did not take.
            memories: of components, by name.
        """
        self._number += 1
        form = {} if message is None else message_form(message, self._short)
        state, version = reactor.machine.state, self._knowledge.version
        self._state.dispatched(under_way, refused)
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
        self.writing.before = version  # the next macrostep may be part of the same transaction

    def end(self, *, finished: bool, problem: str | None) -> None:
        """Keep the end of the run."""
        self.writing.end(self._run, text_of({"finished": finished, "problem": problem}), self._new_records())

    def take_up(self, library: Library) -> Kept:
        """Load the unfinished run, to be resumed; call it outside `writing`.

        Raises:
            StoreError: there is none, or it cannot be read.
            ChangedError: the plots or the domain are not those with which it was begun.
        """
        with archive(self.path, again=True) as runs:  # the knowledge was opened before
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
        """The records since the last call, one a line."""
        lines = [record.to_line() for record in self._records]
        self._records.clear()
        return "\n".join(lines) + "\n" if lines else ""

    def _put_form(self, digest: str, text: str) -> None:
        self.writing.connection.execute("INSERT OR IGNORE INTO forms VALUES (?, ?)", (digest, text))


@lru_cache(maxsize=256)
def _paths_text(configuration: tuple[str, ...]) -> str:
    """Cached: most runs come back to the same few configurations."""
    return text_of(configuration)
