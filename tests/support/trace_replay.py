"""A run's trace held against what the domain says: steps as intervals, and what they rely on in the meantime.

Knows nothing of how plots are generated: only that a state `step_n` says in `about` which step it carries out, and
that its successor `after_n` is left when the step's effects have been seen.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

from standing_links import standing

from knowledge_base.exchange import delta_of
from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax.expression import And, Not, substitute
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.world.overlay import Overlay
from planning import PlanningDomain
from planning.model.plan import Plan, PlanStep
from planning.ordering.causal_tracing import deordered

STATE = re.compile(r"(?:.*/)?(step|after)_(\d+)")


def parsed(text):
    name, *args = text.strip("()").split()
    return PlanStep(name, tuple(args))


@dataclass
class Replay:
    """One plan of a trace; `problems` says what went against the domain.

    Args:
        domain: the planning domain.
        world: as it was when the run began.
        goal: what the plan is for.
        works_for: whether the author of a change carries out a step.
    """

    domain: PlanningDomain
    world: Overlay
    goal: str
    works_for: Callable[[str, PlanStep], bool]
    steps: dict[int, PlanStep] = field(default_factory=dict)
    began: dict[int, float] = field(default_factory=dict)
    ended: dict[int, float] = field(default_factory=dict)
    links: tuple[Any, ...] = ()
    problems: list[str] = field(default_factory=list)

    def take(self, record):
        """The next record of the trace."""
        if record.type == "plan.found":
            plan = Plan(tuple(map(parsed, record.data["steps"])))
            self.steps = dict(enumerate(plan.steps, start=1))
            self.links = deordered(plan, self.domain, self.world, parse_condition(self.goal)).links
        elif record.type == "knowledge":
            self._change(record)
        elif record.type == "step":
            for micro in record.data["microsteps"]:
                for path in micro["exited"]:
                    self._leave(path, record.t)
                for path in micro["entered"]:
                    self._enter(path, record.t)

    def _enter(self, path, t):
        kind, number = _state(path)
        if kind == "step":
            self.began[number] = t
            why = self.domain.why_not(self.steps[number], self.world)
            if not why.truth:
                self.problems.append(f"{t:g}: {self.steps[number]} begins although {why.deciding}")

    def _leave(self, path, t):
        kind, number = _state(path)
        if kind == "after":
            self.ended[number] = t
            self._look(t)

    def _change(self, record):
        delta = delta_of(dict(record.data))
        for number in self.running:
            if self.works_for(record.data["author"], self.steps[number]):
                continue
            for condition in self._needs(number):
                undone = delta.added if isinstance(condition, Not) else delta.removed
                atom = condition.body if isinstance(condition, Not) else condition
                if Fact(atom.predicate, tuple(arg.value for arg in atom.args)) in undone:
                    self.problems.append(f"{record.t:g}: {condition} undone during {self.steps[number]}")
        self.world.apply(delta)
        self._look(record.t)

    def _look(self, t):
        """Everything that later steps rely on is there."""
        for link in standing(self.links, self.ended.keys(), self.began.keys()):
            if not holds(link.fact, self.world):
                self.problems.append(f"{t:g}: {link} is broken")

    @property
    def running(self):
        return [number for number in self.began if number not in self.ended]

    def _needs(self, number):
        step = self.steps[number]
        needed = substitute(self.domain.action(step).precondition, self.domain.bindings(step))
        return needed.parts if isinstance(needed, And) else (needed,)

    def overlapping(self):
        """Pairs of steps that were under way at once."""
        return [
            (one, other)
            for one, other in combinations(sorted(self.began), 2)
            if max(self.began[one], self.began[other]) < min(self.ended[one], self.ended[other])
        ]

    def interfering(self, world):
        """Overlapping pairs of which one deletes what the other needs or adds, by the domain alone."""
        found = []
        for one, other in self.overlapping():
            for first, second in ((one, other), (other, one)):
                gone = {str(fact) for fact in self.domain.effects(self.steps[first], world).removed}
                come = {str(fact) for fact in self.domain.effects(self.steps[second], world).added}
                needed = {f"({' '.join([c.predicate, *(a.value for a in c.args)])})" for c in self._needs(second)}
                if gone & (come | needed):
                    found.append((self.steps[first], self.steps[second], gone & (come | needed)))
        return found


def _state(path):
    found = STATE.fullmatch(path)
    return (found[1], int(found[2])) if found else ("", 0)
