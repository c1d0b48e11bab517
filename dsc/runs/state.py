"""State of a run: every value that a restart needs; each macrostep writes its change (`RunState`)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict
from typing import Any, Protocol

from dsc.components.life_cycle import Life
from dsc.engine.machine import Machine
from dsc.engine.machine_state import FrameState
from dsc.engine.steps import (
    Cancel,
    Note,
    Output,
    Revoke,
    SendLater,
    SendMessage,
    SetParameter,
    SetWire,
    Start,
    StartTimer,
    SwitchMode,
)
from dsc.events import Event
from dsc.messages import (
    KnowledgeMessage,
    LateMessage,
    Message,
    ParameterMessage,
    PlotsMessage,
    SkillMessage,
    TimerMessage,
    Told,
    WireMessage,
)
from dsc.model.plot import ActionPlot
from dsc.runs.encoding import Awaited, awaited_form, events_form, frame_news
from dsc.runs.hashed_forms import Shortener, plot_hashes
from dsc.runs.kept import Kept
from dsc.runs.tables import Form, SnapshotRow
from dsc.trace import text_of

_Key = tuple[str, str]
"""Kind and name of a pending item."""


class ReactorState(Protocol):
    """The part of a reactor that a restart needs.

    Attributes:
        machine: the chart's state.
        emitted: the latest outcome events of the plot.
        in_vain: periods without any effect since the last other message.
        problem: the reason why the run cannot continue, or `None`.
        programming_error: the programming error that is this reason, or the first one of a listener; or `None`.
        outputs: the outputs of the plot, after its end.
        finished: whether the plot has reached its final state without a problem.
        settings: an operator's settings of plot parameters, by plot and parameter.
        plots: the plots that have changed since the start, by name; `None` for a removed plot.
        caused_by: numbers of the trace records about started skills, by action id.
    """

    machine: Machine
    emitted: tuple[Event, ...]
    in_vain: set[tuple[int, int]]
    problem: str | None
    programming_error: str | None
    outputs: Mapping[str, Any]

    @property
    def finished(self) -> bool: ...  # noqa: D102  described above

    settings: dict[tuple[str, str], ParameterMessage]
    plots: Mapping[str, ActionPlot | None]
    caused_by: dict[str, int]


class RunState:
    """Frames, pending actions and timers, and effective parameters and modes.

    Args:
        short: stores each plot one time, and replaces it by its hash.
    """

    def __init__(self, short: Shortener) -> None:
        self._short = short
        self._frames: dict[int, FrameState] = {}
        self._root: FrameState | None = None
        self._remembered: tuple[Any, ...] = ()  # values of the reactor
        self._emitted: tuple[Event, ...] = ()
        self._rows: dict[int, SnapshotRow] = {}  # pending items by place; the earliest first
        self._places: dict[_Key, list[int]] = {}  # the earliest first
        self._activations: dict[int, set[_Key]] = {}
        self._cancelled: list[int] = []  # places of items that the last macrostep cancelled
        self._in_effect: dict[_Key, int] = {}  # places of parameters and modes
        self._outbox: dict[int, Told] = {}  # by place: commands that a component may not have received
        self._last_place = 0
        self._memories: dict[str, str] = {}
        self._reactor: Form = {}
        self._news: Form = {}

    def restore(self, kept: Kept) -> None:
        """Load the state of a kept run."""
        self._root = kept.state.root
        self._frames = _by_serial(self._root)
        self.remember(kept.memory.items())
        self._news.clear()
        for one in kept.pending:
            self._note(one.what, one.place)
            if one.reports and isinstance(one.what, SetParameter | SwitchMode):
                self._in_effect[_key(one.what)] = one.place
            form = awaited_form(one.what, self._short)
            kind = type(one.what).__name__
            self._rows[one.place] = SnapshotRow(
                kind, one.step, one.at, form, one.reports, one.cause, one.cancelled, one.waits, one.turn
            )
            if one.cancelled:
                self._cancelled += self._places.pop(_key(one.what))

    def update(self, reactor: ReactorState) -> None:
        """Store the machine's frames and the other state of the reactor after a macrostep."""
        state = reactor.machine.state
        if state.root is not self._root:
            self._update_frames(state.root)
        serial = None if state.root is None else state.root.serial
        # Most events change none of these values.
        settings = reactor.settings.values()
        # The types distinguish 1 and 1.0, which are equal.
        typed = tuple([(one, type(one.value)) for one in settings]) if settings else ()
        remembered = (
            serial, state.finished, frozenset(reactor.in_vain), reactor.problem, reactor.programming_error, typed,
            reactor.plots,
        )  # fmt: skip
        if remembered != self._remembered or reactor.emitted is not self._emitted:
            self._remembered, self._emitted = remembered, reactor.emitted
            self._reactor = self._news["reactor"] = _reactor_form(reactor, self._short)

    def remember(self, memories: Iterable[tuple[str, Any]]) -> None:
        """Store the memories of components by name, as text, since a component may change the object later."""
        for component, memory in memories:
            text = text_of(memory)
            if self._memories.get(component) != text:
                self._memories[component] = self._news.setdefault("memory", {})[component] = text

    def change(self, *, whole: bool = False) -> str:
        """Return the change since the last call as a line of JSON; empty without a change.

        With `whole`, return the whole state instead.
        """
        news, self._news = self._news, {}
        if whole:
            frames = {serial: frame_news(None, frame, self._short) for serial, frame in self._frames.items()}
            news = {"whole": True, "reactor": self._reactor, "frames": frames, "pending": self._rows}
            news["memory"] = self._memories
        return f"{text_of(news)}\n" if news else ""

    def take(self, message: Message) -> None:
        """Remove the pending item that the message ends, or count a report of it."""
        match message:
            case (
                Event() | KnowledgeMessage() | ParameterMessage() | WireMessage() | PlotsMessage()
            ):  # no pending item waits for them
                pass
            case SkillMessage(start=start, final=False, conflated=conflated):
                for place in self._places.get(_key(start), ()):
                    row = self._rows[place]
                    self._put_row(place, row._replace(reports=row.reports + 1 + conflated))
            case SkillMessage(start=start, continues=continues):
                (self._cancel if continues else self._forget)(_key(start))
            case TimerMessage(timer=timer):
                self._forget(_key(timer))
            case LateMessage() | SendLater():
                self._forget(_key(message), 1)

    def wait(self, start: Start, turn: float | None) -> None:
        """Mark an action that waits for its component, or has waited and got its turn at second `turn`."""
        for place in self._places.get(_key(start), ()):
            self._put_row(place, self._rows[place]._replace(waits=turn is None, turn=turn))

    def dispatched(self, undelivered: Collection[Told], refused: Collection[Told] = ()) -> None:
        """Register that earlier commands were received, except those in `undelivered` and `refused`."""
        for place in self._cancelled:
            self._drop_row(place)
        self._cancelled.clear()
        for place, told in list(self._outbox.items()):
            if not any(told is one for one in undelivered):
                del self._outbox[place]
                if any(told is one for one in refused):
                    self._drop_row(place)
                    if self._in_effect.get(_key(told)) == place:  # the command was repeated after a restart
                        del self._in_effect[_key(told)]
                elif isinstance(told, SendMessage):
                    self._drop_row(place)
                else:
                    self._put_in_effect(_key(told), place)

    def ask(self, output: Iterable[Output], step: int, now: float, reactor: ReactorState) -> None:
        """Store the actions, timers and commands that a macrostep starts, and remove or mark those that it cancels."""
        for one in output:
            match one:
                case Start():
                    self.put(one, step, now, reactor.caused_by.get(one.action_id, 0))
                case StartTimer() | SendLater():
                    self.put(one, step, now + one.seconds)
                case SetWire():
                    self._forget(_key(one))  # the state, or the operator, wires the port again
                    self.put(one, step, now)
                case SetParameter() | SwitchMode() | SendMessage():
                    self.put(one, step, now)
                case Cancel():
                    for key in self._activations.pop(one.activation, ()):
                        self._cancel(key)
                case Revoke():
                    revoked = f"{one.frame} {one.id!r} "
                    for key in [key for key in self._places if key[0] == "SendLater" and key[1].startswith(revoked)]:
                        self._forget(key)
                case Note():
                    pass

    def suspend(self, messages: Iterable[SendMessage], step: int, at: float) -> None:
        """Add messages that a resume sends, except those that it sends anyway."""
        pending = list(self._outbox.values())
        for one in messages:
            if one not in pending:
                self.put(one, step, at)

    def put(self, what: Awaited, step: int, at: float, cause: int = 0) -> None:
        """Add a pending item."""
        place = self._last_place + 1
        self._note(what, place)
        self._put_row(place, SnapshotRow(type(what).__name__, step, at, awaited_form(what, self._short), 0, cause))

    def _update_frames(self, root: FrameState | None) -> None:
        before, now = self._frames, _by_serial(root)
        self._root, self._frames = root, now
        news: dict[int, Form | None] = {}
        for serial, frame in now.items():
            known = before.get(serial)
            if known is not frame:
                news[serial] = frame_news(known, frame, self._short)
        if before.keys() != now.keys():
            news.update(dict.fromkeys(before.keys() - now.keys()))
        self._news["frames"] = news

    def _put_row(self, place: int, row: SnapshotRow) -> None:
        self._rows[place] = row
        self._news.setdefault("pending", {})[place] = row

    def _drop_row(self, place: int) -> None:
        del self._rows[place]
        self._news.setdefault("pending", {})[place] = None

    def _note(self, what: Awaited, place: int) -> None:
        key = _key(what)
        self._last_place = place
        if isinstance(what, SetParameter | SwitchMode | SendMessage):
            self._outbox[place] = what
            return
        self._places.setdefault(key, []).append(place)
        if isinstance(what, Start | StartTimer | SetWire):
            self._activations.setdefault(what.activation, set()).add(key)

    def _cancel(self, key: _Key) -> None:
        """Remove a timer; keep a cancelled action, since a restart may have to cancel it again."""
        if key[0] != Start.__name__:
            self._forget(key)
            return
        for place in self._places.pop(key, ()):
            self._put_row(place, self._rows[place]._replace(cancelled=True))
            self._cancelled.append(place)

    def _put_in_effect(self, key: _Key, place: int) -> None:
        """Register that a component received the command, which replaces the command that was effective before."""
        before = self._in_effect.get(key)
        self._in_effect[key] = place
        if before == place:  # the command was repeated after a restart
            return
        if before is not None:
            self._drop_row(before)
        self._put_row(place, self._rows[place]._replace(reports=1))

    def _forget(self, key: _Key, most: int | None = None) -> None:
        """Remove the pending items of that key, or only the earliest `most`."""
        places = self._places.pop(key, [])
        if most is not None and places[most:]:
            self._places[key] = places[most:]
        for place in places[:most]:
            self._drop_row(place)


def _by_serial(root: FrameState | None) -> dict[int, FrameState]:
    if root is not None and not root.children:
        return {root.serial: root}
    return {} if root is None else {frame.serial: frame for frame in root.frames()}


def _reactor_form(reactor: ReactorState, short: Shortener) -> Form:
    state = reactor.machine.state
    return {
        "root": state.root.serial if state.root else None,
        "finished": state.finished,
        "emitted": events_form(reactor.emitted, short),
        "in_vain": sorted(reactor.in_vain),
        "problem": reactor.problem,
        "programming_error": reactor.programming_error,
        "outputs": dict(reactor.outputs),
        "settings": [asdict(one) for one in reactor.settings.values()],
        "plots": plot_hashes(reactor.plots, short),
    }


def _key(what: Awaited) -> _Key:
    """Return kind and name of a pending item; only a chart's repeated `SendLater` share a key."""
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
        case SwitchMode():  # life cycle state and mode are effective together
            name = f"{what.component} {'life' if what.mode in (Life.INIT, Life.SHUTDOWN) else 'mode'}"
        case SetWire():
            name = f"{what.activation} {what.component} {what.port}"
        case SendMessage():  # each item separately
            name = f"{what.component} {what.port}"
    return type(what).__name__, name
