"""What stands after a macrostep, put together from what each one has changed.

A macrostep writes only what is different since the one before, as a line of JSON in its own row: one row of one table
is all that a commit has to write. Now and then one writes all there is (`whole`), so that nobody has to go back to the
beginning.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

Form = dict[str, Any]


class SnapshotRow(NamedTuple):
    """Something that is awaited or in force, as plain data: what `run_forms.Pending` says of it."""

    kind: str
    step: int
    at: float
    what: Form
    reports: int = 0
    cause: int = 0
    cancelled: bool = False


@dataclass(slots=True)
class RunSnapshot:
    """The present of a run, as plain data.

    Attributes:
        reactor: what it remembers besides the machine's frames.
        frames: running plots by serial number, as `run_forms.frame_news` gives them.
        pending: what is awaited or in force by its number, as `SnapshotRow`.
        memory: what components have to remember, as text by name.
    """

    reactor: Form = field(default_factory=dict)
    frames: dict[int, Form] = field(default_factory=dict)
    pending: dict[int, list[Any]] = field(default_factory=dict)
    memory: dict[str, str] = field(default_factory=dict)

    def take(self, change: Form) -> None:
        """Be as after that change: new values, `None` for what is gone."""
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
    """What stands after the first of these macrosteps, each of them lines of changes; no more are read than needed."""
    needed: list[Form] = []
    for text in latest_first:
        changes = [json.loads(line) for line in text.split("\n") if line]
        needed += reversed(changes)
        if changes and changes[0].get("whole"):
            break
    found = RunSnapshot()
    for change in reversed(needed):
        found.take(change)
    return found
