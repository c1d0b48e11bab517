"""Outcomes of the planning component's skills."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from dsc.outcomes import Outcome

Symbol = Annotated[str, "symbol"]


class PlotFound(Outcome, event="plan_found"):
    """A plan was found, and its plot is generated."""

    plot: Annotated[dict[str, Any], "plot"]
    name: Symbol
    steps: int


class GoalHolds(Outcome):
    """The goal holds."""


class GoalOpen(Outcome):
    """A part of the goal does not hold."""

    reason: str


NoPlanKind = Literal["failed", "invalid", "timed_out", "unsolvable"]


class NoPlan(Outcome):
    """No plan was found: none exists, the time was over, an engine failed, or the goal is invalid."""

    reason: str
    kind: NoPlanKind


class PlanInvalid(Outcome):
    """The plan no longer leads to the goal, after a change by `author`."""

    which: str
    why: str
    author: Symbol


class Withdrawn(Outcome):
    """The step ends, because another author's change broke its condition; parallel steps continue."""


class Replan(Outcome):
    """A new plan is necessary, which only the planner can find."""


class GaveUp(Outcome):
    """The budget of the goal is exhausted."""

    reason: str


class GoalTaken(Outcome):
    """A goal was taken from the queue."""

    goal: Annotated[str, "condition"]
    number: int


class GoalOver(Outcome):
    """The goal was withdrawn, or its deadline has passed."""

    reason: str


class GoalPursued(Outcome):
    """A goal of the queue has ended: it was reached, or the reason why not."""

    reached: bool
    reason: str


class GoalEnded(Outcome):
    """The end of the goal is noted in the queue."""


Repaired = PlotFound | GoalHolds | Replan | GaveUp
"""Answers to the failure of a plan."""
Monitored = GoalHolds | PlotFound | PlanInvalid
"""Ends of the monitoring of a plan."""
