"""How far the watching of a plan is: what was heard and has not been answered, and what is under way beside it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from planning.execution.monitor import Broken, GoalReached, News, Shorter, news_form, news_from
from planning.execution.search import Found, NotFound

if TYPE_CHECKING:
    from collections.abc import Mapping

    from planning.plan import PlanFound


@dataclass(frozen=True, slots=True)
class Better:
    """A planner that goes on has found a better plan."""

    answer: PlanFound


@dataclass(frozen=True, slots=True)
class StepEnded:
    """The step that was not to be interrupted has ended."""


Heard = News | Found | NotFound | Better | StepEnded


@dataclass(slots=True)
class Watched:
    """What has to be known to go on watching after a restart.

    Attributes:
        heard: what has not been answered.
        said_broken: whether it was said that the plan is broken.
        searching_since: second of run time at which a plan began to be looked for beside this one.
        missed: steps that have begun while nobody was watching, after a restart.
    """

    heard: deque[Heard] = field(default_factory=deque)
    said_broken: bool = False
    searching_since: float | None = None
    missed: list[int] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Plain data; plans that were found are looked for again."""
        heard = [_form(one) for one in self.heard if isinstance(one, Broken | Shorter | GoalReached | StepEnded)]
        return {"heard": heard, "said_broken": self.said_broken, "searching_since": self.searching_since}

    @classmethod
    def from_json(cls, form: Mapping[str, Any]) -> Watched:
        """The inverse of `to_json`."""
        heard: deque[Heard] = deque(StepEnded() if one is None else news_from(one) for one in form["heard"])
        return cls(heard, form["said_broken"], form["searching_since"])


def _form(heard: News | StepEnded) -> dict[str, Any] | None:
    return None if isinstance(heard, StepEnded) else news_form(heard)
