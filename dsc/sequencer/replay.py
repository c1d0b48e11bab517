"""Replay of a kept run: a new reactor handles the run's messages, and the results are compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from dsc.dynamic.library import Library
from dsc.engine.steps import Output, Start
from dsc.runs.archive import RunArchive, RunRow, StepRow, archive
from dsc.runs.encoding import message_of, signatures_in
from dsc.runs.hashed_forms import full
from dsc.runs.kept import plots_of
from dsc.sequencer.reactor import Reactor
from dsc.trace import Trace, text_of
from knowledge_base.exchange import delta_form
from knowledge_base.facts import Delta, Value
from knowledge_base.journal.archive import Archive
from knowledge_base.journal.history import MemoryHistory, Version
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


@dataclass(frozen=True, slots=True)
class Divergence:
    """The first difference between a replay and the run.

    Attributes:
        step: number of the macrostep.
        what: name of the result.
        recorded: the result in the run.
        replayed: the result in the replay.
    """

    step: int
    what: str
    recorded: str
    replayed: str

    def __str__(self) -> str:
        """Return one line for people."""
        return f"step {self.step}: {self.what} was: {self.recorded}; now: {self.replayed}"


@dataclass(frozen=True, slots=True)
class Replay:
    """The result of a replay.

    Attributes:
        run: number of the run.
        steps: the number of macrosteps with equal results.
        divergence: the first difference, which ends the replay; `None` without a difference.
    """

    run: int
    steps: int
    divergence: Divergence | None


def replay(
    path: Path | str, run: int | None = None, *, library: Library | None = None, schema: Schema | None = None
) -> Replay:
    """Repeat the macrosteps of a run from its messages, without skills, time or planner.

    Args:
        path: the store, which is only read.
        run: the run's number; by default the last run.
        library: plots for the replay; by default those with which the run began.
        schema: an extension of the store's schema. Conditions need it if they use predicates that Python computes.

    Raises:
        StoreError: the store cannot be read, or has no such run.
        HistoryError: the store no longer has the knowledge at the start of the run.
    """
    path = Path(path)
    with archive(path) as runs:
        row = runs.run(run)
        past = Archive(path.resolve(), schema)
        replayed = _ReplayedRun(runs, row, past, library or plots_of(runs, row))
        steps = 0
        for step in runs.steps(row.number):
            divergence = replayed.take(step)
            if divergence is not None:
                return Replay(row.number, steps, divergence)
            steps += 1
        return Replay(row.number, steps, None)


class _ReplayedRun:
    """A reactor without inbox and dispatcher; its actions are only recorded."""

    def __init__(self, runs: RunArchive, row: RunRow, past: Archive, library: Library) -> None:
        self._runs = runs
        self._row = row
        self._past = past
        start = Version(past.state(row.version, past.newest), row.version, 0.0)
        self._knowledge = KnowledgeBase(past.schema, lambda: 0.0, MemoryHistory(start))
        of_run = str(row.header.get("action_ids", ""))
        self._now = 0.0
        self._reactor = Reactor(library, self._knowledge, Trace(lambda: self._now), run=of_run)
        self._knowledge.provide(self._reactor.relations)
        self._reactor.know_skills(signatures_in(row.header, runs.form))
        self._rows: dict[str, list[tuple[Value, ...]]] = {}
        self._started: dict[str, Start] = {}

    def take(self, step: StepRow) -> Divergence | None:
        """Repeat one macrostep; return its first result that differs, or `None`."""
        self._now = step.time
        for change in self._past.changes(self._knowledge.version, step.before):  # changes of other authors
            self._knowledge.apply(change.delta, change.author)
        self._provide(step.relations)
        action_id = step.message.get("action")
        if action_id not in (None, *self._started):
            return Divergence(step.number, "what is answered", f"the action {action_id}", "not started at all")
        self._note(self._output(step))
        now = self._reactor.machine.state.configuration()
        if now != step.configuration:
            return Divergence(step.number, "the configuration", _names_text(step.configuration), _names_text(now))
        recorded = [change.delta for change in self._past.changes(step.before, step.version)]
        replayed = [change.delta for change in self._knowledge.changes(step.before)]
        if recorded != replayed:
            return Divergence(step.number, "what was told", _describe(recorded), _describe(replayed))
        return None

    def _provide(self, relations: Mapping[str, list[list[Value]]]) -> None:
        """Provide the rows that other parts than the chart have provided in the run."""
        for name, rows in relations.items():
            is_new = name not in self._rows
            self._rows[name] = [*map(tuple, rows)]
            if is_new:
                self._knowledge.provide({name: partial(self._rows.__getitem__, name)})
        if relations:
            self._knowledge.renew_relations(*relations)

    def _output(self, step: StepRow) -> tuple[Output, ...]:
        if step.message:
            return self._reactor.react(message_of(step.message, self._started.__getitem__, self._runs.form))
        if step.number > 1:
            return self._reactor.leave()
        serials = self._runs.serials_before(self._row.number)
        return self._reactor.start(self._row.plot, full(self._row.arguments, self._runs.form), serials)

    def _note(self, output: Iterable[Output]) -> None:
        self._started.update({one.action_id: one for one in output if isinstance(one, Start)})


def _names_text(configuration: Iterable[str]) -> str:
    return ", ".join(configuration) or "empty"


def _describe(deltas: Iterable[Delta]) -> str:
    return "; ".join(text_of(delta_form(delta)) for delta in deltas) or "nothing"
