"""What a run needs to go on, kept up to date: after each macrostep only what has changed is written."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Collection, Iterable
from typing import Any

from dsc.components.life import Life
from dsc.dynamic.library import Library
from dsc.engine.state import FrameState, MachineState
from dsc.engine.steps import (
    Cancel,
    Output,
    Revoke,
    SendLater,
    SendMessage,
    SetParameter,
    Start,
    StartTimer,
    SwitchMode,
)
from dsc.sequencer.messages import LateMessage, Message, SkillMessage, TimerMessage
from dsc.sequencer.reactor import Reactor
from dsc.sequencer.run_forms import (
    Awaited,
    Form,
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
from dsc.sequencer.telling import Told

_INSERT = "INSERT INTO pending VALUES (?, ?, ?, ?, ?, 0, ?, 0)"
_CANCELLED = "UPDATE pending SET cancelled = 1 WHERE place = ?"
_FORGET = "DELETE FROM pending WHERE place = ?"
_REPORTED = "UPDATE pending SET reports = reports + 1 WHERE place = ?"
_FRAME = "INSERT INTO frames VALUES (?, ?) ON CONFLICT DO UPDATE SET frame = excluded.frame"  # REPLACE takes longer
_CLEAR = ("DELETE FROM frames", "DELETE FROM pending", "DELETE FROM memory")
_SELECT_PENDING = "SELECT place, kind, step, at, what, reports, cause, cancelled FROM pending ORDER BY place"
_LAST_REACTOR = "SELECT reactor FROM steps ORDER BY place DESC LIMIT 1"

_Key = tuple[str, str]
"""Kind and name of something pending."""


class Present:
    """Frames, what is awaited, and what is in force; `short` puts the plots in it away."""

    def __init__(self, short: Shortener) -> None:
        self._short = short
        self._root: FrameState | None = None
        self._frames: dict[int, FrameState] = {}
        self._places: dict[_Key, list[int]] = {}  # of what is pending, in the table; the earliest first
        self._activations: dict[int, set[_Key]] = {}
        self._cancelled: list[int] = []  # places of what the last macrostep cancelled
        self._in_force: dict[_Key, int] = {}  # places of parameters and modes
        self._telling: dict[int, Told] = {}  # by place: of this it is not known whether it has been taken
        self._last_place = 0
        self._memory: dict[str, str] = {}
        self._reactor: Form = {}
        self._reactor_text = ""

    def clear(self, connection: sqlite3.Connection) -> None:
        """A new run begins."""
        for statement in _CLEAR:
            connection.execute(statement)
        self._reactor = {}

    def restored(self, kept: Kept) -> None:
        """This is what the tables have."""
        root = self._root = kept.state.root
        self._frames = {frame.serial: frame for frame in root.frames()} if root else {}
        for one in kept.pending:
            self._note(one.what, one.place)
            if one.cancelled:
                self._cancelled += self._places.pop(_key(one.what))

    def frames(self, connection: sqlite3.Connection, root: FrameState | None) -> None:
        """Write the machine's frames that have changed."""
        if root is self._root:
            return
        before = self._frames
        self._root = root
        self._frames = {frame.serial: frame for frame in root.frames()} if root else {}
        for serial in before.keys() - self._frames.keys():
            connection.execute("DELETE FROM frames WHERE serial = ?", (serial,))
        for serial, frame in self._frames.items():
            if before.get(serial) is not frame:
                connection.execute(_FRAME, (serial, frame_text(frame, self._short)))

    def reactor(self, reactor: Reactor) -> str:
        """What else the reactor remembers."""
        state = reactor.machine.state
        form = {
            "root": state.root.serial if state.root else None,
            "serials": state.serials,
            "finished": state.finished,
            "emitted": events_form(reactor.emitted, self._short),
            "in_vain": sorted(reactor.in_vain),
            "problem": reactor.problem,
        }
        if form != self._reactor:  # most events change none of it
            self._reactor, self._reactor_text = form, text_of(form)
        return self._reactor_text

    def memory(self, connection: sqlite3.Connection, component: str, memory: Any) -> None:
        """Write what a component has to remember, if it is not what it was."""
        text = text_of(memory)
        if self._memory.get(component) != text:
            connection.execute("INSERT OR REPLACE INTO memory VALUES (?, ?)", (component, text))
            self._memory[component] = text

    def taken(self, connection: sqlite3.Connection, message: Message) -> None:
        """What came is awaited no longer."""
        match message:
            case SkillMessage(start=start, final=False):
                connection.executemany(_REPORTED, [(place,) for place in self._places.get(_key(start), ())])
            case SkillMessage(start=start, goes_on=goes_on):
                (self._cancel if goes_on else self._forget)(connection, _key(start))
            case TimerMessage(timer=timer):
                self._forget(connection, _key(timer))
            case LateMessage() | SendLater():
                self._forget(connection, _key(message), 1)

    def left(self, connection: sqlite3.Connection, under_way: Collection[Told]) -> None:
        """What the macrostep before asked for has left; all that was told has been taken, but for what is under way."""
        for place in self._cancelled:
            connection.execute(_FORGET, (place,))
        self._cancelled.clear()
        for place, told in list(self._telling.items()):
            if not any(told is one for one in under_way):
                del self._telling[place]
                if self._in_force.get(_key(told)) != place:
                    connection.execute(_FORGET, (place,))

    def asked(
        self, connection: sqlite3.Connection, output: Iterable[Output], step: int, now: float, reactor: Reactor
    ) -> None:
        """What is awaited from now on, or no longer, and what is in force."""
        for one in output:
            match one:
                case Start():
                    self.put(connection, one, step, now, reactor.caused_by.get(one.action_id, 0))
                case StartTimer() | SendLater():
                    self.put(connection, one, step, now + one.seconds)
                case SetParameter() | SwitchMode() | SendMessage():
                    self._overtake(connection, _key(one))
                    self.put(connection, one, step, now)
                case Cancel():
                    for key in self._activations.pop(one.activation, ()):
                        self._cancel(connection, key)
                case Revoke():
                    revoked = f"{one.frame} {one.id!r} "
                    for key in [key for key in self._places if key[0] == "SendLater" and key[1].startswith(revoked)]:
                        self._forget(connection, key)

    def put(self, connection: sqlite3.Connection, what: Awaited, step: int, at: float, cause: int = 0) -> None:
        """Write one thing that is awaited, or in force."""
        self._note(what, self._last_place + 1)
        row = (self._last_place, type(what).__name__, step, at, awaited_text(what, self._short), cause)
        connection.execute(_INSERT, row)

    def _note(self, what: Awaited, place: int) -> None:
        key = _key(what)
        self._last_place = place
        if isinstance(what, SetParameter | SwitchMode | SendMessage):
            self._telling[place] = what
            if not isinstance(what, SendMessage):
                self._in_force[key] = place
            return
        self._places.setdefault(key, []).append(place)
        if isinstance(what, Start | StartTimer):
            self._activations.setdefault(what.activation, set()).add(key)

    def _cancel(self, connection: sqlite3.Connection, key: _Key) -> None:
        """A timer is gone; an action that has not ended may have to be cancelled once more after a restart."""
        if key[0] != Start.__name__:
            self._forget(connection, key)
            return
        for place in self._places.pop(key, ()):
            connection.execute(_CANCELLED, (place,))
            self._cancelled.append(place)

    def _overtake(self, connection: sqlite3.Connection, key: _Key) -> None:
        """Something else is in force; what has not been taken yet still has to be, and in order."""
        place = self._in_force.pop(key, None)
        if place is not None and place not in self._telling:
            connection.execute(_FORGET, (place,))

    def _forget(self, connection: sqlite3.Connection, key: _Key, most: int | None = None) -> None:
        """Delete what is pending under that key, or only the earliest so many."""
        places = self._places.pop(key, [])
        if most is not None and places[most:]:
            self._places[key] = places[most:]
        for place in places[:most]:
            connection.execute(_FORGET, (place,))


def read(runs: RunArchive, run: RunRow, library: Library) -> Kept:
    """The unfinished run as it is kept.

    Raises:
        UnknownNameError: the library lacks one of the plots, or a plot one of the states.
    """
    connection, find = runs.connection, runs.form
    steps = list(runs.steps(run.number))
    machine = json.loads(connection.execute(_LAST_REACTOR).fetchone()[0])
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
            Pending(place, awaited_of(kind, what, find), step, at, reports, cause, bool(cancelled))
            for place, kind, step, at, what, reports, cause, cancelled in connection.execute(_SELECT_PENDING)
        ]),
        memory={name: json.loads(memory) for name, memory in connection.execute("SELECT * FROM memory")},
        records=tuple(record for step in steps for record in step.records),
    )  # fmt: skip


def _key(what: Awaited) -> _Key:
    """By which it is found again; only what the chart sends later, again and again, may have the key of another."""
    match what:
        case Start():
            name = what.action_id
        case StartTimer():
            name = f"{what.activation} {what.event} {what.index}"
        case SendLater():
            name = f"{what.event.frame} {what.id!r} {what.event.name} {what.seconds}"
        case LateMessage():
            name = str(what.number)
        case SetParameter():
            name = f"{what.component} {what.parameter}"
        case SwitchMode():  # whether it lives and what it does then are in force side by side
            name = f"{what.component} {'life' if what.mode in (Life.INIT, Life.SHUTDOWN) else 'mode'}"
        case SendMessage():  # each one for itself
            name = f"{what.component} {what.port}"
    return type(what).__name__, name
