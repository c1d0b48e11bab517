"""A kept run as a restart resumes it, if the plots and the domain are those with which it began."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dsc.dynamic.library import Library
from dsc.engine.machine_state import MachineState
from dsc.errors import ChangedError
from dsc.events import Event
from dsc.messages import ParameterMessage
from dsc.model.plot import ActionPlot
from dsc.runs.archive import RunArchive, RunRow
from dsc.runs.encoding import Awaited, awaited_of, events_of, frame_form
from dsc.runs.tables import SnapshotRow
from dsc.trace import Record
from knowledge_base.errors import Place


@dataclass(frozen=True, slots=True)
class Pending:
    """A pending item: an action, timer or message without its end yet, or a parameter or mode in effect.

    Attributes:
        place: of the row.
        what: the output of the machine that asked for it, or a message from outside with a later time.
        step: number of the macrostep that asked.
        at: second of run time at which a skill was started, or at which another item is due.
        reports: number of intermediate events of a skill so far; of a parameter or mode, 1 once it is in effect.
        cause: number of the trace record about a skill's start.
        cancelled: whether the last macrostep has cancelled the skill.
    """

    place: int
    what: Awaited
    step: int
    at: float
    reports: int = 0
    cause: int = 0
    cancelled: bool = False


@dataclass(frozen=True, slots=True)
class Kept:
    """A run after its last macrostep.

    Attributes:
        run: its row, with plot and arguments.
        number: that of the macrostep.
        time: its second of run time.
        state: of the machine.
        emitted, in_vain, problem, settings: as of `Reactor`.
        pending: in the order in which it was asked for.
        memory: of components, by name.
        records: of the trace, so far.
    """

    run: RunRow
    number: int
    time: float
    state: MachineState
    emitted: tuple[Event, ...]
    in_vain: frozenset[tuple[int, int]]
    problem: str | None
    settings: tuple[ParameterMessage, ...]
    pending: tuple[Pending, ...]
    memory: Mapping[str, Any]
    records: tuple[Record, ...]

    @property
    def last_record(self) -> int:
        """Number of the last kept record."""
        return self.records[-1].seq if self.records else 0


def read(runs: RunArchive, run: RunRow, library: Library) -> Kept:
    """The unfinished run after its last kept macrostep.

    Raises:
        UnknownNameError: the library lacks one of the plots, or a plot one of the states.
        DamagedStoreError: the run differs from the written one.
    """
    find = runs.form
    steps = list(runs.steps(run.number))
    last, now = steps[-1], runs.latest_snapshot()
    reactor = now.reactor
    root = None if reactor["root"] is None else frame_form(reactor["root"], now.frames, find)
    rows = [(place, SnapshotRow(*row)) for place, row in sorted(now.pending.items())]
    pending = [
        Pending(place, awaited_of(row.kind, row.what, find), row.step, row.at, row.reports, row.cause, row.cancelled)
        for place, row in rows
    ]
    state = {"root": root, "serials": last.serials, "finished": reactor["finished"]}
    return Kept(
        run=run,
        number=last.number,
        time=last.time,
        state=MachineState.from_json(state, library),
        emitted=events_of(reactor["emitted"], find),
        in_vain=frozenset((activation, index) for activation, index in reactor["in_vain"]),
        problem=reactor["problem"],
        settings=tuple([ParameterMessage(**setting) for setting in reactor["settings"]]),
        pending=tuple(pending),
        memory={name: json.loads(memory) for name, memory in now.memory.items()},
        records=tuple(record for step in steps for record in step.records),
    )  # fmt: skip


def require_unchanged(runs: RunArchive, run: RunRow, library: Library, domain: Mapping[str, str]) -> None:
    """Raise `ChangedError` if a plot, or another thing that plots rely on, has changed since the run began."""
    found = [*_changed_plots(runs, run, library), *_changed_statements(run.domain, domain)]
    if found:
        raise ChangedError(found, place=Place(str(runs.path)))


def plots_of(runs: RunArchive, run: RunRow) -> Library:
    """The plots with which the run was begun."""
    return Library(ActionPlot.model_validate(runs.form(digest)) for digest in run.plots.values())


def _changed_plots(runs: RunArchive, run: RunRow, library: Library) -> Iterator[str]:
    from dsc.text.plot_difference import differences  # noqa: PLC0415  loads the drawing, too; only a changed plot needs it

    before = plots_of(runs, run)
    for plot in before:
        if plot.name not in library:
            yield f"the plot '{plot.name}' is missing"
        elif plot != library.plot(plot.name):
            what = ", ".join(map(str, differences(plot, library.plot(plot.name))))
            yield f"the plot '{plot.name}' has changed: {what or 'its description'}"
    for plot in library:
        if plot.name not in before:
            yield f"the plot '{plot.name}' is new"


def _changed_statements(before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    for name, text in before.items():
        if name not in now:
            yield f"the {name} is missing"
        elif now[name] != text:
            yield f"the {name} was '{text}', now it is '{now[name]}'"
    yield from (f"the {name} is new" for name in now if name not in before)
