"""PlanRun is a plan in execution, from its plot to its end; PlanRuns keeps them by name.

Attempt chooses the escalation step for a failed plan, after the rules of a plot and before `gave_up` (S1.4, S4.2). The
same failure in the same situation never gets the same answer twice. Each answer and their number are bounded.
"""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Any

from knowledge_base.errors import UnknownNameError
from knowledge_base.language.syntax.text import parse_condition, to_text
from planning.execution.monitor import Broken, GoalReached, News, Shorter, news_form, news_from
from planning.execution.plan_progress import PlanProgress
from planning.execution.search import Found, NotFound
from planning.plan import PlanStep

if TYPE_CHECKING:
    from collections.abc import Mapping

    from knowledge_base.language.syntax.expression import Expression
    from planning.execution.planner_call import Improvements
    from planning.plan import PlanFound
    from planning.problem.derived import Settled

MOST_UNMONITORED = 64
"""The number of unmonitored plans that are kept. A new plan may replace one; the chart abandons others silently."""
_PLAIN = ("name", "holder", "seconds", "replans", "replaces", "searching_since")


MOST_RESUMED = 3
"""The number of times that one attempt resumes at the same step without a new plan."""


class EscalationStep(Enum):
    """The answers to a failed plan, in the order in which they are tried."""

    RESUME = "the same plan goes on"
    OTHER_CANDIDATE = "the same plan goes on, the step done in another way"
    REPLAN = "a new plan"
    EXCLUDE = "a new plan without the step"
    GIVE_UP = "giving up"


@dataclass(frozen=True, slots=True)
class Failure:
    """A step that failed.

    Attributes:
        step: the step.
        why: the outcome, or the condition that did not hold.
        situation: digest of the world then; see `situation`.
    """

    step: PlanStep
    why: str
    situation: str


@dataclass(slots=True)
class Attempt:
    """The answers given so far on the way to one goal, over all plans for it.

    Attributes:
        replans: the number of plans that replaced a failed one.
        failures: the number of times that each failure occurred in the same situation.
        resumed: the number of times that a plan resumed at a step.
    """

    replans: int = 0
    failures: Counter[Failure] = field(default_factory=Counter)
    resumed: Counter[PlanStep] = field(default_factory=Counter)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        failures = [[one.step.to_json(), one.why, one.situation, often] for one, often in self.failures.items()]
        resumed = [[step.to_json(), often] for step, often in self.resumed.items()]
        return {"replans": self.replans, "failures": failures, "resumed": resumed}

    @classmethod
    def from_json(cls, form: Mapping[str, Any]) -> Attempt:
        """The inverse of `to_json`."""
        failures = {
            Failure(PlanStep.from_json(step), why, where): often for step, why, where, often in form["failures"]
        }
        resumed = {PlanStep.from_json(step): often for step, often in form["resumed"]}
        return cls(form["replans"], Counter(failures), Counter(resumed))

    def failed(self, failure: Failure, *, stands: bool, others: bool) -> EscalationStep:
        """Count a failure and return the answer to it.

        Args:
            failure: the failed step and its reason.
            stands: whether the plan still leads to the goal, the step included.
            others: whether another candidate implements the step.
        """
        self.failures[failure] += 1
        if stands and self.resumed[failure.step] < MOST_RESUMED:
            answers = [
                EscalationStep.RESUME,
                *([EscalationStep.OTHER_CANDIDATE] if others else []),
                EscalationStep.EXCLUDE,
            ]
        else:
            answers = [EscalationStep.REPLAN, EscalationStep.EXCLUDE]
        tried = self.failures[failure] - 1
        return answers[tried] if tried < len(answers) else EscalationStep.GIVE_UP

    def interrupted(self, step: PlanStep | None) -> EscalationStep:
        """Return the answer for a plan that its monitor stopped; `step` is the one at which it could resume."""
        return (
            EscalationStep.RESUME if step is not None and self.resumed[step] < MOST_RESUMED else EscalationStep.REPLAN
        )


class PlanState(Enum):
    """The states of a `PlanRun`."""

    BOUND = "bound"
    """It has a plot; monitoring has not begun."""
    MONITORED = "monitored"
    """Its monitor watches the causal links of its remaining steps."""
    BROKEN = "broken"
    """The monitor reported that the remaining steps no longer lead to the goal."""
    STOPPED = "stopped"
    """Monitoring ended it before its steps did."""


@dataclass(frozen=True, slots=True)
class Successor:
    """The steps that replace a plan; after its active step, if they begin with that one.

    Attributes:
        steps: the steps.
        name: of their plot; `None` if they are steps of the same plan.
        kept: the number of steps of the same plan that they end with.
        found: the search's answer that they are from, unless a restart lost it.
    """

    steps: tuple[PlanStep, ...]
    name: str | None = None
    kept: int = 0
    found: Found | None = field(default=None, compare=False)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {"steps": [step.to_json() for step in self.steps], "name": self.name, "kept": self.kept}

    @classmethod
    def from_json(cls, form: Mapping[str, Any]) -> Successor:
        """The inverse of `to_json`."""
        return cls(tuple(map(PlanStep.from_json, form["steps"])), form["name"], form["kept"])


@dataclass(frozen=True, slots=True)
class Better:
    """A planner that improves plans has found a better one."""

    answer: PlanFound


@dataclass(frozen=True, slots=True)
class StepEnded:
    """The active step, the last one before a successor, has ended."""


Heard = News | Found | NotFound | Better | StepEnded
"""The news that monitoring answers."""


@dataclass(slots=True)
class PlanRun:
    """A plan that has a plot.

    Attributes:
        name: of its plot.
        goal: the goal that it is for.
        progress: its done, running and remaining steps.
        attempt: the earlier answers to failures on the way to the goal.
        holder, seconds, replans: the rules, bound and budget of the dynamic state that it is for.
        improvements: better plans from its planner.
        replaces: name of the plan that it replaces when its own monitoring begins.
        state: see `PlanState`.
        successor: the steps that replace it.
        begun: numbers of the steps of its plot that have begun.
        news: unanswered news, oldest first.
        searching_since: second of run time at which a search for a successor began.
        missed: numbers of the steps that began between a restart and the monitor's own restart.
        on_begin: receives the number of each step that begins, while the plan is monitored.
        superseded: set when no more of its steps may begin, while the active one continues.
    """

    name: str
    goal: Expression
    progress: PlanProgress
    attempt: Attempt
    holder: str
    seconds: float
    replans: int
    improvements: Improvements | None = None
    replaces: str | None = None
    state: PlanState = PlanState.BOUND
    successor: Successor | None = None
    begun: set[int] = field(default_factory=set)
    news: deque[Heard] = field(default_factory=deque)
    searching_since: float | None = None
    missed: list[int] = field(default_factory=list)
    on_begin: Callable[[int], None] | None = None
    superseded: asyncio.Event = field(default_factory=asyncio.Event)

    def begin(self, number: int) -> None:
        """Begin a step of its plot; after a restart the same number may come twice."""
        again = number in self.begun
        self.begun.add(number)
        if self.on_begin is not None:
            self.on_begin(number)
        elif self.state is PlanState.BOUND:
            self.progress.begin(number)
        elif not again:
            self.missed.append(number)

    def follow(self, successor: Successor) -> bool:
        """Set the successor; return whether it begins with the active step, which then continues."""
        self.successor = successor
        if self.progress.steps_of(self.progress.running) != successor.steps[:1]:
            return False
        self.progress = PlanProgress(successor.steps, self.progress.domain, self.progress.goal)
        self.progress.begin(1)
        self.superseded.set()
        self.state = PlanState.MONITORED
        return True

    def shortened(self, steps: tuple[PlanStep, ...]) -> Successor:
        """The successor with other steps; without one, these steps of the plan itself."""
        return Successor(steps) if self.successor is None else replace(self.successor, steps=steps)

    def renew(self, now: Settled) -> None:
        """Rewrite the conditions of its steps for another state of the world."""
        self.progress = self.progress.renewed(now.domain, now.condition(self.goal))

    def to_json(self) -> dict[str, Any]:
        """Plain data, without improvements and without plans that are found again after a restart."""
        return {
            **{name: getattr(self, name) for name in _PLAIN},
            "goal": to_text(self.goal),
            "progress": self.progress.to_json(),
            "attempt": self.attempt.to_json(),
            "state": self.state.value,
            "successor": None if self.successor is None else self.successor.to_json(),
            "begun": sorted(self.begun),
            "news": [_form(one) for one in self.news if isinstance(one, Broken | Shorter | GoalReached | StepEnded)],
        }

    @classmethod
    def from_json(cls, form: Mapping[str, Any], now: Settled) -> PlanRun:
        """The inverse of `to_json`, with conditions written for the present state of the world."""
        goal = parse_condition(form["goal"])
        run = cls(
            goal=goal,
            progress=PlanProgress.from_json(form["progress"], now.domain, now.condition(goal)),
            attempt=Attempt.from_json(form["attempt"]),
            state=PlanState(form["state"]),
            successor=None if form["successor"] is None else Successor.from_json(form["successor"]),
            begun=set(form["begun"]),
            news=deque(StepEnded() if one is None else news_from(one) for one in form["news"]),
            **{name: form[name] for name in _PLAIN},
        )
        if run.successor is not None and run.state is not PlanState.STOPPED:
            run.superseded.set()
        return run


class PlanRuns:
    """The plans that have a plot and are not over."""

    def __init__(self) -> None:
        self._runs: dict[str, PlanRun] = {}
        self._named = 0

    def new_name(self) -> str:
        """A name that no earlier plan of the program's run has."""
        self._named += 1
        return f"plan_{self._named}"

    def get(self, name: str) -> PlanRun | None:
        """The plan of that name, if there is one."""
        return self._runs.get(name)

    def required(self, name: str) -> PlanRun:
        """The plan of that name; raises `UnknownNameError`."""
        if name not in self._runs:
            raise UnknownNameError(f"there is no plan '{name}'", found=name, valid=self._runs)
        return self._runs[name]

    def add(self, run: PlanRun) -> None:
        """Keep a plan, and forget the oldest ones beyond `MOST_UNMONITORED` that have no monitor."""
        unmonitored = [name for name, one in self._runs.items() if one.on_begin is None]
        for name in unmonitored[:-MOST_UNMONITORED]:
            del self._runs[name]
        self._runs[run.name] = run

    def over(self, name: str) -> None:
        """Forget a plan, the one that it replaces, and a successor that has not begun."""
        run = self._runs.pop(name, None)
        if run is not None and run.replaces is not None:
            self.over(run.replaces)
        self.withdraw(name)

    def withdraw(self, name: str) -> None:
        """Forget a successor of the plan that has not begun, since the chart did not take it."""
        for successor in [one.name for one in self._runs.values() if one.replaces == name]:
            del self._runs[successor]

    def begin(self, run: PlanRun) -> None:
        """Begin the monitoring of a plan, which ends the one that it replaces."""
        replaced, run.replaces = run.replaces, None
        if replaced is not None:
            self.over(replaced)

    def remember(self) -> dict[str, Any]:
        """Plain data."""
        return {"plans": self._named, "runs": [one.to_json() for one in self._runs.values()]}

    def recall(self, memory: Mapping[str, Any], now: Settled) -> None:
        """The inverse of `remember`, with conditions written for the present state of the world."""
        self._named = memory["plans"]
        self._runs = {form["name"]: PlanRun.from_json(form, now) for form in memory["runs"]}


def _form(heard: News | StepEnded) -> dict[str, Any] | None:
    return None if isinstance(heard, StepEnded) else news_form(heard)
