"""Records of plots that run as skills, in the trace of their caller: inner states are below the skill's state (S2.6).

A `Relay` listens to the inner run and reports its records. An `InnerRun` writes them into the caller's trace, so that
remote states look like local states.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

from dsc.calls import SkillCall
from dsc.run_log import run_logger
from dsc.trace import Record, Trace

_LOG = run_logger(__package__)
_RELAYED = frozenset({"plot", "event", "step", "decision", "rule", "action", "log"})
_PLANS = "plan."
_MOST_CAUSES = 1_000
"""Number of the latest records of an inner run that later records may name as their cause."""


class Relay:
    """A listener that reports the records of an inner run to its caller, those of one turn of the loop together.

    Args:
        call: the execution of the plot as a skill.
    """

    def __init__(self, call: SkillCall[Any]) -> None:
        self._call = call
        self._lines: list[str] = []

    def __call__(self, record: Record) -> None:
        """Add a record, if a caller wants its type: worlds, their changes and ends belong to the inner run."""
        if record.type in _RELAYED or record.type.startswith(_PLANS):
            if not self._lines:
                asyncio.get_running_loop().call_soon(self.flush)
            self._lines.append(record.to_line())

    def flush(self) -> None:
        """Report the added records now."""
        if self._lines:
            lines, self._lines = self._lines, []
            self._call.record(lines)


class InnerRun:
    """The part of a trace about a plot that runs as a skill.

    Args:
        action: the id of the skill's execution.
        at: path of the state that has triggered the skill.
        cause: number of the record about the start of the skill.
        shown: whether states are written; two skills of one state would mix their states.
    """

    def __init__(self, action: str, at: str, cause: int | None, *, shown: bool = True) -> None:
        self.at = at
        self._action = action
        self._cause = cause
        self._shown = shown
        self._states: dict[str, None] = {}
        self._skills: dict[int, Mapping[str, Any]] = {}  # starts that run, by the inner number of their record
        self._causes: dict[int, int] = {}  # numbers of this trace by inner numbers

    @property
    def is_shown(self) -> bool:
        """Whether the run has active states in the trace."""
        return self._shown and bool(self._states)

    def receive(self, line: str, trace: Trace, known_plots: set[str]) -> None:
        """Write a record of the inner run into the trace; a plot that the trace has already is not repeated."""
        try:
            record = Record.from_line(line)
            _require_shape(record)
            written = self._data(record)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            _LOG.warning("a record of the action '%s' cannot be read: %r", self._action, error)
            return
        if record.type == "plot":
            if record.data["hash"] in known_plots:
                return
            known_plots.add(record.data["hash"])
        if record.type == "step" and not self._shown:
            return
        self.note(record.type, written)
        before = trace.cause
        unknown = None if record.type == "event" else self._cause  # an event without a cause ends no skill
        trace.cause = unknown if record.cause is None else self._causes.get(record.cause, unknown)
        if record.type == "event" and record.cause is not None:
            self._skills.pop(record.cause, None)
        elif record.type == "action" and record.data["action"] == "start":
            self._skills[record.seq] = written
        elif record.type == "action" and record.data["action"] == "cancel":
            self._skills = {seq: one for seq, one in self._skills.items() if one["id"] != written["id"]}
        self._causes[record.seq] = trace.record(record.type, **written)
        if len(self._causes) > _MOST_CAUSES:
            del self._causes[next(iter(self._causes))]
        trace.cause = before

    def note(self, type_: str, data: Mapping[str, Any]) -> None:
        """Note the active states after a record of this trace, also of an interrupted run."""
        for micro in data["microsteps"] if type_ == "step" else ():
            for path in micro["exited"]:
                self._states.pop(path, None)
            self._states.update(dict.fromkeys(micro["entered"]))

    def leave(self, trace: Trace) -> None:
        """Write the exit of the states, and the end of the skills, that are active when the outer skill ends."""
        if self._states:
            left = {"event": None, "taken": [], "exited": [*reversed(self._states)], "entered": []}
            trace.record("step", microsteps=[left], of=self._action)
        for one in self._skills.values():
            trace.record("action", action="cancel", id=one["id"], skill=one["skill"], of=self._action)

    def _data(self, record: Record) -> dict[str, Any]:
        """Return the data of a record, with states below the outer state, and ids below the outer action."""
        data = dict(record.data)
        match record.type:
            case "step":
                data["microsteps"] = [self._micro(one) for one in data["microsteps"]]
                if "variables" in data:
                    data["variables"] = {self._path(path): values for path, values in data["variables"].items()}
            case "decision" | "rule":
                data["state"] = self._path(data["state"])
            case "action" if "id" in data and "/" not in data["id"]:  # an id of real time has its run, and is unique
                data["id"] = f"{self._action}/{data['id']}"
        return {**data, "of": self._action}

    def _micro(self, micro: Mapping[str, Any]) -> dict[str, Any]:
        taken = [
            {**one, "from": self._path(one["from"]), "to": one["to"] and self._path(one["to"])}
            for one in micro["taken"]
        ]
        exited, entered = ([self._path(path) for path in micro[key]] for key in ("exited", "entered"))
        said = {**micro, "taken": taken, "exited": exited, "entered": entered}
        if "bound" in micro:
            said["bound"] = [{**one, "state": self._path(one["state"])} for one in micro["bound"]]
        return said

    def _path(self, inner: str) -> str:
        return f"{self.at}/{inner}" if inner else self.at


_NEEDED = {"plot": {"hash": str}, "action": {"action": str}, "decision": {"state": str}, "rule": {"state": str}}
"""Types of the data that this module reads, by the type of the record."""


def _require_shape(record: Record) -> None:
    """Raise `TypeError` or `KeyError` for a record of another shape, which another program may have sent."""
    needed = dict(_NEEDED.get(record.type, {}))
    if record.type == "action" and record.data["action"] in {"start", "cancel"}:
        needed |= {"id": str, "skill": str}
    wrong = [name for name, kind in needed.items() if not isinstance(record.data[name], kind)]
    if wrong or type(record.seq) is not int or not isinstance(record.cause, int | None):
        raise TypeError(f"wrong {', '.join(wrong) or 'number or cause'}")
    for micro in record.data["microsteps"] if record.type == "step" else ():
        if not all(isinstance(path, str) for path in (*micro["exited"], *micro["entered"])):
            raise TypeError("a state is a text")
