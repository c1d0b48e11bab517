"""Snapshot of a run's state after a macrostep, put together from the changes of macrosteps.

A macrostep writes only its change, as a line of JSON in its own row. So a commit writes one row of one table.
Periodically a macrostep writes the whole state (`whole`), which bounds the rows that a reader needs.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

Form = dict[str, Any]


class SnapshotRow(NamedTuple):
    """A pending item as plain data, see `encoding.Pending`."""

    kind: str
    step: int
    at: float
    what: Form
    reports: int = 0
    cause: int = 0
    cancelled: bool = False


@dataclass(slots=True)
class RunSnapshot:
    """State of a run, as plain data.

    Attributes:
        reactor: its state besides the machine's frames.
        frames: running plots by serial number, as `encoding.frame_news` gives them.
        pending: pending items by number, as `SnapshotRow`.
        memory: of components, as text by name.
    """

    reactor: Form = field(default_factory=dict)
    frames: dict[int, Form] = field(default_factory=dict)
    pending: dict[int, list[Any]] = field(default_factory=dict)
    memory: dict[str, str] = field(default_factory=dict)

    def apply(self, change: Form) -> None:
        """Apply a change: new values, `None` for those that are gone."""
        if "reactor" in change:
            self.reactor = change["reactor"]
        for serial, news in change.get("frames", {}).items():
            if news is None:
                del self.frames[int(serial)]
            else:
                self.frames[int(serial)] = self.frames.get(int(serial), {}) | news
        self.memory.update(change.get("memory", {}))
        for place, row in change.get("pending", {}).items():
            if row is None:
                self.pending.pop(int(place), None)  # it may have come and gone in one macrostep
            else:
                self.pending[int(place)] = row


def latest_snapshot(latest_first: Iterable[str]) -> RunSnapshot:
    """The snapshot after the first of these macrosteps, each lines of changes; reads no more than needed."""
    needed: list[Form] = []
    for text in latest_first:
        changes = [json.loads(line) for line in text.split("\n") if line]
        needed += reversed(changes)
        if changes and changes[0].get("whole"):
            break
    found = RunSnapshot()
    for change in reversed(needed):
        found.apply(change)
    return found
