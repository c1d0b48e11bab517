"""Counts of a run, computed from its records."""

from __future__ import annotations

from collections import Counter

from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.trace import Record


class Tally:
    """A trace listener that counts records.

    Attributes:
        outcomes: number of each outcome event of skills.
        recoveries: number of uses of each rule, by its label.
        candidates: number of choices of each plot by dynamic states, without choices of planning.
        plans: number of plans found; `replans`: number of plans that replaced a running plan.
        wrong_plans: number of plans of the planner that do not lead to the goal.
        excluded: number of exclusions of each plan step after failures.
        unobserved: number of times that the effects of each planning action were not observed.
        gave_up: the reason of the last goal for which there was no plan or no further plan; empty without
            one, and after a later plan.
        seconds: run time of the last record, in seconds.
    """

    def __init__(self) -> None:
        self.outcomes: Counter[str] = Counter()
        self.recoveries: Counter[str] = Counter()
        self.candidates: Counter[str] = Counter()
        self.excluded: Counter[str] = Counter()
        self.unobserved: Counter[str] = Counter()
        self.plans = 0
        self.replans = 0
        self.wrong_plans = 0
        self.gave_up = ""
        self.seconds = 0.0

    def __call__(self, record: Record) -> None:
        """Update the counts for one record."""
        self.seconds = record.t
        if record.type == "event" and "." in record.data["source"]:
            self.outcomes[record.data["name"]] += 1
        elif record.type == "decision" and record.data["chosen"] not in (None, ACHIEVE):
            self.candidates[record.data["chosen"]] += 1
        elif record.type == "rule":
            self.recoveries[record.data["rule"]] += 1
        elif record.type == "plan.found":
            self.plans += 1
            self.gave_up = ""
        elif record.type == "plan.replaced":
            self.replans += 1
        elif record.type == "plan.wrong":
            self.wrong_plans += 1
        elif record.type == "plan.excluded":
            self.excluded[record.data["step"]] += 1
        elif record.type == "plan.unobserved":
            self.unobserved[record.data["step"].strip("()").split()[0]] += 1
        elif record.type in {"plan.gave_up", "plan.none"}:
            self.gave_up = record.data["reason"]
