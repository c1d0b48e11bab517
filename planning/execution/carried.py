"""A plan on its way, as the planning component remembers it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from knowledge_base.language.parser import parse_condition
from knowledge_base.language.printer import to_text
from planning.execution.progress import PlanProgress
from planning.execution.repair import Attempt
from planning.execution.watched import Watched
from planning.plan import PlanStep

if TYPE_CHECKING:
    from collections.abc import Mapping

    from knowledge_base.language.expression import Expression
    from planning.execution.improvements import Improvements
    from planning.problem.derived import Settled

_PLAIN = (
    "name", "holder", "seconds", "replans", "following_name", "following_kept", "stopped",
)  # fmt: skip


@dataclass(slots=True)
class Carried:
    """A plan that has a plot, and is or was carried out.

    Attributes:
        name: its plot's.
        goal: what was asked for.
        course: how far it is.
        attempt: what has been tried for its goal.
        holder, seconds, replans: of the dynamic state that it is for.
        better: what comes of a planner that goes on after it.
        following: steps that take its place; if their plan began with the step at work, once that has ended.
        following_name: what the plot of these steps will be called; `None` if they are steps of this very plan.
        following_kept: how many steps of this plan they end with.
        told: steps of its plot that have begun.
        watched: how far watching it is; `None` before that begins.
        begun: is told when a step begins, while the plan is watched.
        stopped: who watched it ended it; otherwise a step did.
        superseded: is set when no more of its steps shall begin, but the one at work goes on.
    """

    name: str
    goal: Expression
    course: PlanProgress
    attempt: Attempt
    holder: str
    seconds: float
    replans: int
    better: Improvements | None = None
    following: tuple[PlanStep, ...] | None = None
    following_name: str | None = None
    following_kept: int = 0
    told: set[int] = field(default_factory=set)
    watched: Watched | None = None
    begun: Callable[[int], None] | None = None
    stopped: bool = False
    superseded: asyncio.Event = field(default_factory=asyncio.Event)

    def begin(self, number: int) -> None:
        """A step of its plot has begun; what was told before a restart may be told again."""
        again = number in self.told
        self.told.add(number)
        if self.begun is not None:
            self.begun(number)
        elif self.watched is None:
            self.course.begin(number)
        elif not again:
            self.watched.missed.append(number)

    def to_json(self) -> dict[str, Any]:
        """Plain data; a planner that goes on is not part of it."""
        return {
            **{name: getattr(self, name) for name in _PLAIN},
            "goal": to_text(self.goal),
            "course": self.course.to_json(),
            "attempt": self.attempt.to_json(),
            "following": None if self.following is None else [step.to_json() for step in self.following],
            "told": sorted(self.told),
            "watched": None if self.watched is None else self.watched.to_json(),
        }

    @classmethod
    def from_json(cls, form: Mapping[str, Any], now: Settled) -> Carried:
        """The inverse of `to_json`, with conditions written for the present state of the world."""
        goal = parse_condition(form["goal"])
        carried = cls(
            goal=goal,
            course=PlanProgress.from_json(form["course"], now.domain, now.condition(goal)),
            attempt=Attempt.from_json(form["attempt"]),
            following=None if form["following"] is None else tuple(map(PlanStep.from_json, form["following"])),
            told=set(form["told"]),
            watched=None if form["watched"] is None else Watched.from_json(form["watched"]),
            **{name: form[name] for name in _PLAIN},
        )
        if carried.following is not None and not carried.stopped:
            carried.superseded.set()
        return carried
