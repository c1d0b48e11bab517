"""What a run needs to go on, kept up to date: after each macrostep only what has changed is written."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable
from typing import Any

from dsc.dynamic.library import Library
from dsc.engine.state import FrameState, MachineState
from dsc.engine.steps import Cancel, Output, Revoke, SendLater, SetParameter, Start, StartTimer, SwitchMode
from dsc.sequencer.dispatcher import SkillMessage, TimerMessage
from dsc.sequencer.messages import LateMessage, Message
from dsc.sequencer.reactor import Reactor
from dsc.sequencer.run_forms import (
    Awaited,
    Kept,
    Pending,
    Shortener,
    awaited_of,
    awaited_text,
    events_form,
    events_of,
    frame_form,
    frame_text,
    text_of,
)
from dsc.sequencer.run_tables import RunArchive, RunRow

_INSERT = "INSERT INTO pending (kind, name, activation, step, at, what, reports, cause) VALUES (?, ?, ?, ?, ?, ?, 0, ?)"
_FIRST_DUE = """DELETE FROM pending WHERE place =
    (SELECT place FROM pending WHERE kind = ? AND name = ? AND what = ? ORDER BY at LIMIT 1)"""
_REPORTED = "UPDATE pending SET reports = reports + 1 WHERE kind = 'Start' AND name = ?"
_MACHINE = "INSERT OR REPLACE INTO machine VALUES (1, ?)"
_FRAME = "INSERT OR REPLACE INTO frames VALUES (?, ?)"
_CLEAR = ("DELETE FROM frames", "DELETE FROM machine", "DELETE FROM pending", "DELETE FROM memory")
_SELECT_PENDING = "SELECT kind, step, at, what, reports, cause FROM pending ORDER BY place"


class Present:
    """Frames, what is awaited, and what is in force; `short` puts the plots in it away."""

    def __init__(self, short: Shortener) -> None:
        self._short = short
        self._root: FrameState | None = None
        self._frames: dict[int, FrameState] = {}
        self._machine = ""
        self._memory: dict[str, str] = {}

    def clear(self, connection: sqlite3.Connection) -> None:
        """A new run begins."""
        for statement in _CLEAR:
            connection.execute(statement)

    def restored(self, state: MachineState) -> None:
        """This is what the tables have."""
        self._root = state.root
        self._frames = {frame.serial: frame for frame in state.root.frames()} if state.root else {}

    def machine(self, connection: sqlite3.Connection, reactor: Reactor) -> None:
        """Write the machine's frames that have changed, and what else the reactor remembers."""
        state = reactor.machine.state
        if state.root is not self._root:
            self._write_frames(connection, state.root)
        text = text_of({
            "root": state.root.serial if state.root else None,
            "serials": state.serials,
            "finished": state.finished,
            "emitted": events_form(reactor.emitted, self._short),
            "in_vain": sorted(reactor.in_vain),
            "problem": reactor.problem,
        })  # fmt: skip
        if text != self._machine:
            connection.execute(_MACHINE, (text,))
            self._machine = text

    def memory(self, connection: sqlite3.Connection, component: str, memory: Any) -> None:
        """Write what a component has to remember, if it is not what it was."""
        text = text_of(memory)
        if self._memory.get(component) != text:
            connection.execute("INSERT OR REPLACE INTO memory VALUES (?, ?)", (component, text))
            self._memory[component] = text

    def taken(self, connection: sqlite3.Connection, message: Message) -> None:
        """What came is awaited no longer."""
        match message:
            case SkillMessage(start=start, final=True):
                _forget(connection, "Start", start.action_id)
            case SkillMessage(start=start):
                connection.execute(_REPORTED, (start.action_id,))
            case TimerMessage(timer=timer):
                _forget(connection, "StartTimer", _name(timer))
            case LateMessage():
                _forget(connection, "LateMessage", _name(message))
            case SendLater():
                connection.execute(_FIRST_DUE, ("SendLater", _name(message), awaited_text(message, self._short)))

    def asked(
        self, connection: sqlite3.Connection, output: Iterable[Output], step: int, now: float, reactor: Reactor
    ) -> None:
        """What is awaited from now on, or no longer, and what is in force."""
        for one in output:
            match one:
                case Start():
                    self.put(connection, one, step, now, one.activation, reactor.caused_by.get(one.action_id, 0))
                case StartTimer():
                    self.put(connection, one, step, now + one.seconds, one.activation)
                case SendLater():
                    self.put(connection, one, step, now + one.seconds)
                case SetParameter() | SwitchMode():
                    _forget(connection, type(one).__name__, _name(one))
                    self.put(connection, one, step, now)
                case Cancel():
                    connection.execute("DELETE FROM pending WHERE activation = ?", (one.activation,))
                case Revoke():
                    _forget(connection, "SendLater", f"{one.frame} {one.id}")

    def put(
        self, connection: sqlite3.Connection, what: Awaited, step: int, at: float,
        activation: int | None = None, cause: int = 0,
    ) -> None:  # fmt: skip
        """Write one thing that is awaited, or in force."""
        row = (type(what).__name__, _name(what), activation, step, at, awaited_text(what, self._short), cause)
        connection.execute(_INSERT, row)

    def _write_frames(self, connection: sqlite3.Connection, root: FrameState | None) -> None:
        before = self._frames
        self._root = root
        self._frames = {frame.serial: frame for frame in root.frames()} if root else {}
        for serial in before.keys() - self._frames.keys():
            connection.execute("DELETE FROM frames WHERE serial = ?", (serial,))
        for serial, frame in self._frames.items():
            if before.get(serial) is not frame:
                connection.execute(_FRAME, (serial, frame_text(frame, self._short)))


def read(runs: RunArchive, run: RunRow, library: Library) -> Kept:
    """The unfinished run as it is kept.

    Raises:
        UnknownNameError: the library lacks one of the plots, or a plot one of the states.
    """
    connection, find = runs.connection, runs.form
    steps = list(runs.steps(run.number))
    machine = json.loads(connection.execute("SELECT machine FROM machine").fetchone()[0])
    frames = dict(connection.execute("SELECT serial, frame FROM frames"))
    root = None if machine["root"] is None else frame_form(machine["root"], frames, find)
    state = {"root": root, "serials": machine["serials"], "finished": machine["finished"]}
    return Kept(
        run=run,
        number=steps[-1].number,
        time=steps[-1].time,
        state=MachineState.from_json(state, library),
        emitted=events_of(machine["emitted"], find),
        in_vain=frozenset((activation, index) for activation, index in machine["in_vain"]),
        problem=machine["problem"],
        pending=tuple([
            Pending(awaited_of(kind, what, find), step, at, reports, cause)
            for kind, step, at, what, reports, cause in connection.execute(_SELECT_PENDING)
        ]),
        memory={name: json.loads(memory) for name, memory in connection.execute("SELECT * FROM memory")},
        records=tuple(record for step in steps for record in step.records),
    )  # fmt: skip


def _forget(connection: sqlite3.Connection, kind: str, name: str) -> None:
    connection.execute("DELETE FROM pending WHERE kind = ? AND name = ?", (kind, name))


def _name(what: Awaited) -> str:
    """By which it is found again; only what the chart sends later may have the name of another."""
    match what:
        case Start():
            return what.action_id
        case StartTimer():
            return f"{what.activation} {what.event} {what.index}"
        case SendLater():
            return f"{what.event.frame} {what.id}"
        case LateMessage():
            return str(what.number)
        case SetParameter():
            return f"{what.component} {what.parameter}"
    return what.component
