"""Counts of a run, from its records alone."""

from __future__ import annotations

from collections import Counter

from dsc.dynamic.candidate_selection import ACHIEVE
from dsc.trace import Record


class Tally:
    """A trace listener that counts.

    Attributes:
        outcomes: events that skills ended with.
        recoveries: rules that answered, by their label.
        candidates: plots that dynamic states chose, without planning.
        plans: plans that were found; `replans`: plans that replaced a running one.
        excluded: steps that plans avoided for a while after a failure.
        seconds: run time of the last record.
    """

    def __init__(self) -> None:
        self.outcomes: Counter[str] = Counter()
        self.recoveries: Counter[str] = Counter()
        self.candidates: Counter[str] = Counter()
        self.excluded: Counter[str] = Counter()
        self.plans = 0
        self.replans = 0
        self.seconds = 0.0

    def __call__(self, record: Record) -> None:
        """Count one record."""
        self.seconds = record.t
        if record.type == "event" and "." in record.data["source"]:
            self.outcomes[record.data["name"]] += 1
        elif record.type == "decision" and record.data["chosen"] not in (None, ACHIEVE):
            self.candidates[record.data["chosen"]] += 1
        elif record.type == "rule":
            self.recoveries[record.data["rule"]] += 1
        elif record.type == "plan.found":
            self.plans += 1
        elif record.type == "plan.replaced":
            self.replans += 1
        elif record.type == "plan.excluded":
            self.excluded[record.data["step"]] += 1
