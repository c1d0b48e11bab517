"""Conditions that the states of a run watch or have watched, from the records of the run (S2.19)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from dsc.trace import Record

_WATCHES = (".watch_values", ".watch_truth")
_FLIPS = {"became_true": True, "became_false": False}


@dataclass(slots=True)
class Watched:
    """A condition, as of the last record.

    Attributes:
        text: the condition.
        skill: the skill that evaluates it, e.g. `conditions.watch_truth`.
        since: second at which the state was entered.
        truth: the reported truth; `None` before the first report.
        parts: the truth of each part at the last report, by its text.
        values: the values that the condition read at the last report.
        reports: number of reports.
        last: second of the last report.
        ended: second at which the state was left, or the evaluation failed; `None` while the condition is watched.
    """

    text: str
    skill: str
    since: float
    truth: bool | None = None
    parts: dict[str, bool | None] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    reports: int = 0
    last: float | None = None
    ended: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the condition as plain data."""
        return asdict(self)


def conditions_in(records: Iterable[Record]) -> list[Watched]:
    """Return the conditions of a run in the order of their beginning."""
    by_start: dict[int, Watched] = {}
    by_id: dict[str, Watched] = {}
    for record in records:
        data = record.data
        if record.type == "action" and str(data.get("skill", "")).endswith(_WATCHES):
            if data["action"] == "start":
                text = str(data.get("arguments", {}).get("condition", ""))
                by_start[record.seq] = by_id[data["id"]] = Watched(text, data["skill"], record.t)
            elif data["action"] == "cancel" and data["id"] in by_id:
                _end(by_id[data["id"]], record.t)
        elif record.type == "event" and record.cause in by_start:
            _report(by_start[record.cause], record)
    return list(by_start.values())


def _report(one: Watched, record: Record) -> None:
    event = record.data.get("original", record.data["name"])
    if event not in _FLIPS:
        _end(one, record.t)
        return
    attributes = record.data["attributes"]
    one.truth, one.last, one.reports = _FLIPS[event], record.t, one.reports + 1
    one.parts, one.values = attributes.get("parts", {}), attributes.get("values", {})


def _end(one: Watched, at: float) -> None:
    if one.ended is None:
        one.ended = at
