"""Plan runs: a plan that has a plot, and its state from the plot to its end (S1.4, S4.2)."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Any

from knowledge_base.language.syntax.text import parse_condition, to_text
from planning.execution.link_monitor import Broken, GoalReached, News, Shorter, news_form, news_from
from planning.execution.outcomes import Withdrawn
from planning.execution.plan_progress import PlanProgress
from planning.execution.search_results import Found, NotFound
from planning.model.plan import PlanStep

if TYPE_CHECKING:
    from collections.abc import Mapping

    from knowledge_base.language.syntax.expression import Expression
    from planning.execution.attempt import Attempt
    from planning.execution.planner_call import Improvements
    from planning.model.plan import PlanFound
    from planning.problem.derived import Settled

_PLAIN = (
    "name",
    "holder",
    "seconds",
    "replans",
    "replaces",
    "searching_since",
    "disturbed",
    "rejected",
    "monitored_for",
    "overtaken",
    "replaced",
)


class PlanState(Enum):
    """The states of a `PlanRun`."""

    BOUND = "bound"
    """The plan has a plot, and monitoring has not begun."""
    MONITORED = "monitored"
    """The monitor watches the causal links of the remaining steps."""
    BROKEN = "broken"
    """The monitor reported that the remaining steps no longer lead to the goal."""
    STOPPED = "stopped"
    """Monitoring ended the plan before its last step."""


@dataclass(frozen=True, slots=True)
class Successor:
    """The steps that replace a plan; running steps with which they begin continue.

    Attributes:
        steps: the steps of the successor.
        name: the name of the successor's plot; `None` if the steps belong to the same plan.
        kept: the number of last steps of the replaced plan with which the successor ends.
        found: the result of the search that found the steps; `None` if a restart lost the result.
    """

    steps: tuple[PlanStep, ...]
    name: str | None = None
    kept: int = 0
    found: Found | None = field(default=None, compare=False)

    def to_json(self) -> dict[str, Any]:
        """Return the successor as plain data, without `found`."""
        return {"steps": [step.to_json() for step in self.steps], "name": self.name, "kept": self.kept}

    @classmethod
    def from_json(cls, form: Mapping[str, Any]) -> Successor:
        """Return the successor that `to_json` wrote as `form`."""
        return cls(tuple(map(PlanStep.from_json, form["steps"])), form["name"], form["kept"])


@dataclass(frozen=True, slots=True)
class Better:
    """News that an `Improving` planner has found a better plan."""

    answer: PlanFound


PlanNews = News | Found | NotFound | Better
"""The news that `MonitorSkill` handles."""


@dataclass(slots=True)
class PlanRun:
    """A plan that has a plot, and the state of its execution.

    Attributes:
        name: the name of the plan and of its plot.
        goal: the goal of the plan.
        progress: done, running and remaining steps.
        attempt: the earlier failures for the goal, and the answers to them.
        holder, seconds, replans: the plot with the inherited rules, the time limit of a search and the replan budget.
        improvements: better plans of the planner.
        replaces: the name of the plan that this plan replaces when its monitoring begins.
        state: see `PlanState`.
        successor: the steps that replace this plan; `None` without a replacement.
        begun: the labels of the steps that have begun.
        news: unhandled news, oldest first.
        searching_since: the run time, in seconds, at which a search for a successor began.
        missed: the labels of the steps that began after a restart of the program and before a restart of the monitor.
        on_begin: receives the number in `progress` of each step that begins; `None` while the plan is not monitored.
        disturbed: whether changes by another author, and no failure, ended the plan.
        rejected: whether the simulation foresees that coming steps fail, so that the plan must not continue.
        labels: for each step, its number in the plot; by default, the steps count from 1. A step of a replaced plan
            keeps its number, and other steps have new ones, so that equal numbers of successive plots mean equal steps.
        replaced: the name of the replaced plan whose running steps may continue in this plan; empty without one.
        origins: the plans in whose plots running steps have begun, by label, if not in the plot of this plan.
        withdrawn: the labels of steps that end while parallel steps continue.
        overtaken: whether the plan begins although it does not lead to the goal; see `Found.overtaken`.
        monitored_for: the activation that monitors the plan; 0 before the first one.
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
    news: deque[PlanNews] = field(default_factory=deque)
    searching_since: float | None = None
    missed: list[int] = field(default_factory=list)
    on_begin: Callable[[int], None] | None = None
    disturbed: bool = False
    rejected: bool = False
    labels: tuple[int, ...] = ()
    replaced: str = ""
    origins: dict[int, str] = field(default_factory=dict)
    withdrawn: set[int] = field(default_factory=set)
    monitored_for: int = 0
    overtaken: bool = False
    _holds: dict[int, asyncio.Future[None]] = field(default_factory=dict)

    @property
    def task(self) -> str:
        """The goal with the plot that holds it; of equal goals, each plot has its own attempt."""
        return task_of(self.goal, self.holder)

    def __post_init__(self) -> None:
        self.labels = self.labels or tuple(range(1, len(self.progress.steps) + 1))

    def begin(self, label: int) -> None:
        """Record that a step of the plot begins; after a restart, a label may arrive twice.

        A step of a replaced plan may begin just before the replacement. If this plan lacks the step, it has ended.
        """
        if label not in self.labels:
            return
        again = label in self.begun
        self.begun.add(label)
        if self.on_begin is not None:
            self.on_begin(self.number(label))
        elif self.state is PlanState.BOUND:
            self.progress.begin(self.number(label))
        elif not again:
            self.missed.append(label)

    def number(self, label: int) -> int:
        """Return the number in `progress` of the step with this label."""
        return self.labels.index(label) + 1

    def continuing(self, steps: Iterable[PlanStep]) -> tuple[int, ...]:
        """Return the numbers of the running steps with which `steps` begin, in the order of `steps`."""
        others = {number: self.progress.steps[number - 1] for number in self.progress.running}
        found = []
        for step in steps:
            same = next((number for number, other in others.items() if other == step), None)
            if same is None:
                break
            found.append(same)
            del others[same]
        return tuple(found)

    def labels_for(self, steps: Sequence[PlanStep]) -> tuple[int, ...]:
        """Return the labels of the steps of a plan that replaces this one while it runs."""
        progress = self.progress
        known = [(progress.steps[number - 1], self.labels[number - 1]) for number in progress.remaining]
        following, labels = max(self.labels, default=0) + 1, []
        for step in steps:
            same = next((one for one in known if one[0] == step), None)
            if same is None:
                labels.append(following)
                following += 1
            else:
                labels.append(same[1])
                known.remove(same)
        return tuple(labels)

    def take_over(self, replaced: PlanRun, running: int) -> None:
        """Continue the first steps of this plan, which are running steps of the plan that it replaces."""
        self.replaced = replaced.name
        self._holds = replaced._holds
        for number, label in enumerate(self.labels[:running], start=1):
            self.origins[label] = replaced.origins.get(label, replaced.name)
            self.begun.add(label)
            self.progress.begin(number)

    def carries(self, name: str) -> bool:
        """Return whether running steps of the plan of that name may continue in this plan."""
        return name in (self.name, self.replaced, *self.origins.values())

    async def hold(self, label: int) -> Withdrawn:
        """Return when the step with this label is withdrawn."""
        withdrawn = self._holds[label] = asyncio.get_running_loop().create_future()
        try:
            if label not in self.withdrawn:
                await withdrawn
            return Withdrawn()
        finally:
            if self._holds.get(label) is withdrawn:
                del self._holds[label]

    def withdraw(self, number: int) -> None:
        """End the running step `number` of the progress, while parallel steps continue."""
        label = self.labels[number - 1]
        self.progress.withdraw(number)
        self.withdrawn.add(label)
        if label in self._holds and not self._holds[label].done():
            self._holds[label].set_result(None)

    def shortened(self, steps: tuple[PlanStep, ...]) -> Successor:
        """Return the successor with other steps; without a successor, return these steps of the plan as one."""
        return Successor(steps) if self.successor is None else replace(self.successor, steps=steps)

    def renew(self, now: Settled) -> None:
        """Expand the conditions of the steps for another state of the world."""
        self.progress = self.progress.renewed(now.domain, now.condition(self.goal))

    def to_json(self) -> dict[str, Any]:
        """Return the run as plain data, without news and improvements that a new search finds after a restart."""
        return {
            **{name: getattr(self, name) for name in _PLAIN},
            "goal": to_text(self.goal),
            "progress": self.progress.to_json(),
            "state": self.state.value,
            "successor": None if self.successor is None else self.successor.to_json(),
            "begun": sorted(self.begun),
            "withdrawn": sorted(self.withdrawn),
            "labels": list(self.labels),
            "origins": sorted(self.origins.items()),
            "news": [news_form(one) for one in self.news if isinstance(one, Broken | Shorter | GoalReached)],
        }

    @classmethod
    def from_json(cls, form: Mapping[str, Any], now: Settled, attempt: Attempt) -> PlanRun:
        """Return the run that `to_json` wrote as `form`.

        Args:
            form: the run as plain data.
            now: the domain with conditions expanded for the present world.
            attempt: the attempt at the run's goal.
        """
        goal = parse_condition(form["goal"])
        return cls(
            goal=goal,
            progress=PlanProgress.from_json(form["progress"], now.domain, now.condition(goal)),
            attempt=attempt,
            state=PlanState(form["state"]),
            successor=None if form["successor"] is None else Successor.from_json(form["successor"]),
            begun=set(form["begun"]),
            withdrawn=set(form["withdrawn"]),
            labels=tuple(form["labels"]),
            origins=dict(form["origins"]),
            news=deque(map(news_from, form["news"])),
            **{name: form[name] for name in _PLAIN},
        )


def task_of(goal: Expression, holder: str) -> str:
    """Return the goal, with the plot whose rules its plans inherit, as text."""
    return f"{holder}: {to_text(goal)}"
