"""Kept runs in the form that a restart resumes, and the check that plots and domain are unchanged."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dsc.dynamic.experience import NO_EXPERIENCE, Experience
from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.dynamic.library import Library
from dsc.dynamic.steps import offers_for
from dsc.engine.machine_forms import read_state
from dsc.engine.machine_state import MachineState
from dsc.errors import ChangedError
from dsc.events import Event
from dsc.messages import ParameterMessage
from dsc.model.plot import ActionPlot
from dsc.model.states import DynamicState, SubmachineState
from dsc.runs.archive import RunArchive, RunRow
from dsc.runs.encoding import Awaited, awaited_of, events_of, frame_form
from dsc.runs.hashed_forms import full_value, plots_of_hashes
from dsc.runs.tables import SnapshotRow
from dsc.trace import Record
from knowledge_base.errors import Place

EXPERIENCE = "experience"
"""Key of a run's header with the hash of its experience."""


@dataclass(frozen=True, slots=True)
class Pending:
    """A pending item: an unfinished action, a timer, a message, or an effective parameter or mode.

    Attributes:
        place: the item's number in `RunSnapshot.pending`.
        what: the output of the machine that requested the item, or a scheduled message from outside.
        step: number of the macrostep that requested the item.
        at: second of run time at which a skill was started, or for which another item is scheduled.
        reports: number of a skill's intermediate events so far; for a parameter or mode, 1 as soon as it is effective.
        cause: number of the trace record about a skill's start.
        cancelled: whether the last macrostep has cancelled the skill.
        waits: whether the skill has to wait for the turn of its component.
        turn: second of run time at which a skill that has waited got its turn; `None` without a turn or a wait.
    """

    place: int
    what: Awaited
    step: int
    at: float
    reports: int = 0
    cause: int = 0
    cancelled: bool = False
    waits: bool = False
    turn: float | None = None


@dataclass(frozen=True, slots=True)
class Kept:
    """A run after its last macrostep.

    Attributes:
        run: the run's row, with plot and arguments.
        number: number of the last macrostep.
        time: second of run time of the last macrostep.
        state: state of the machine.
        emitted: as in `Reactor`.
        in_vain: as in `Reactor`.
        problem: as in `Reactor`.
        programming_error: as in `Reactor`.
        outputs: as in `Reactor`.
        settings: the values of `Reactor.settings`.
        plots: as in `Reactor`.
        experience: the tries for learned choices.
        pending: pending items, in the order of their requests.
        memory: memories of components, by component name.
        records: trace records so far.
    """

    run: RunRow
    number: int
    time: float
    state: MachineState
    emitted: tuple[Event, ...]
    in_vain: frozenset[tuple[int, int]]
    problem: str | None
    programming_error: str | None
    outputs: Mapping[str, Any]
    settings: tuple[ParameterMessage, ...]
    plots: Mapping[str, ActionPlot | None]
    experience: Experience
    pending: tuple[Pending, ...]
    memory: Mapping[str, Any]
    records: tuple[Record, ...]

    @property
    def last_record(self) -> int:
        """Number of the last kept record; 0 without records."""
        return self.records[-1].seq if self.records else 0


def read(runs: RunArchive, run: RunRow, library: Library) -> Kept:
    """Return the unfinished run after its last kept macrostep.

    Raises:
        UnknownNameError: the library lacks a plot, or a plot lacks a state.
        DamagedStoreError: the run differs from the written one.
    """
    find = runs.form
    steps = list(runs.steps(run.number))
    last, now = steps[-1], runs.latest_snapshot()
    reactor = now.reactor
    root = None if reactor["root"] is None else frame_form(reactor["root"], now.frames, find)
    rows = [(place, SnapshotRow(*row)) for place, row in sorted(now.pending.items())]
    pending = [
        Pending(
            place,
            awaited_of(row.kind, row.what, find),
            row.step,
            row.at,
            row.reports,
            row.cause,
            row.cancelled,
            row.waits,
            row.turn,
        )
        for place, row in rows
    ]
    plots = plots_of_hashes(reactor.get("plots", {}), find)
    library = library.copy()
    library.change(plots)
    state = {"root": root, "serials": last.serials, "finished": reactor["finished"]}
    return Kept(
        run=run,
        number=last.number,
        time=last.time,
        state=read_state(state, library),
        emitted=events_of(reactor["emitted"], find),
        in_vain=frozenset((activation, index) for activation, index in reactor["in_vain"]),
        problem=reactor["problem"],
        programming_error=reactor["programming_error"],
        outputs=reactor["outputs"],
        settings=tuple([ParameterMessage(**setting) for setting in reactor["settings"]]),
        plots=plots,
        experience=_experience_of(runs, run),
        pending=tuple(pending),
        memory={name: json.loads(memory) for name, memory in now.memory.items()},
        records=tuple(record for step in steps for record in step.records),
    )  # fmt: skip


def require_unchanged(runs: RunArchive, run: RunRow, library: Library, domain: Mapping[str, str]) -> None:
    """Raise `ChangedError` if a plot that the run may use, or a definition, has changed since the run began.

    A plot that the run itself has changed may also have the changed form.
    """
    plots = [*_changed_plots(runs, run, library, {})]
    if plots:
        own = plots_of_hashes(runs.latest_snapshot().reactor.get("plots", {}), runs.form)
        plots = [*_changed_plots(runs, run, library, own)]
    found = [*plots, *_changed_statements(run.domain, domain)]
    if found:
        raise ChangedError(found, place=Place(str(runs.path)))


def plots_of(runs: RunArchive, run: RunRow) -> Library:
    """Return the plots with which the run began, and its experience."""
    library = Library(ActionPlot.model_validate(runs.form(digest)) for digest in run.plots.values())
    library.experience = _experience_of(runs, run)
    return library


def _experience_of(runs: RunArchive, run: RunRow) -> Experience:
    form = full_value(run.header.get(EXPERIENCE), runs.form)
    return NO_EXPERIENCE if form is None else Experience.from_form(form)


def _changed_plots(
    runs: RunArchive, run: RunRow, library: Library, own: Mapping[str, ActionPlot | None]
) -> Iterator[str]:
    """Yield the differences between the plots of a program and those of a run, which has itself changed `own`."""
    from dsc.text.plot_difference import differences  # noqa: PLC0415  loads the drawing, too; only a changed plot needs it

    before = plots_of(runs, run)
    reachable = _reachable(run.plot, before) | _reachable(run.plot, library)
    for plot in before:
        present = library.plot(plot.name) if plot.name in library else None
        if plot.name not in reachable or (plot.name in own and own[plot.name] == present):
            continue
        if present is None:
            yield f"the plot '{plot.name}' is missing"
        elif plot != present:
            what = ", ".join(map(str, differences(plot, present)))
            yield f"the plot '{plot.name}' has changed: {what or 'its description'}"
    for plot in library:
        if plot.name in reachable and plot.name not in before and plot != own.get(plot.name):
            yield f"the plot '{plot.name}' is new"


def _reachable(first: str, library: Library) -> set[str]:
    """Return the names of the plots that a run of the plot `first` may use, with plans for its goals.

    A state that runs the plot in a variable may run every plot, apart from the state of `achieve`, which runs plans.
    """
    found: set[str] = set()
    agenda = [first]
    while agenda:
        name = agenda.pop()
        if name in found or name not in library:
            continue
        found.add(name)
        plot = library.plot(name)
        agenda += plot.uses()
        agenda += [one.name for one in offers_for(plot, library)]
        states = [state for _, state, _ in plot.walk()]
        if any(isinstance(state, DynamicState) and state.goal is not None for state in states):
            agenda.append(ACHIEVE)
        if name == ACHIEVE:
            agenda += [one.name for one in library if one.implements]
        elif any(isinstance(state, SubmachineState) and state.use.startswith("?") for state in states):
            agenda += [one.name for one in library]
    return found


def _changed_statements(before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    for name, text in before.items():
        if name not in now:
            yield f"the {name} is missing"
        elif now[name] != text:
            yield f"the {name} was '{text}', now it is '{now[name]}'"
    yield from (f"the {name} is new" for name in now if name not in before)
