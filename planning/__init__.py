"""From a goal to a plan to an action plot, and back again when the world disagrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from planning.cache import CachingPlanner as CachingPlanner
    from planning.domain import PlanningAction as PlanningAction
    from planning.domain import PlanningDomain as PlanningDomain
    from planning.executive import Executive as Executive
    from planning.plan import Plan as Plan
    from planning.plan import PlanStep as PlanStep
    from planning.planner import Planner as Planner
    from planning.planner import PlannerProcess as PlannerProcess
    from planning.plot import plot_from_plan as plot_from_plan
    from planning.problem import pose as pose
    from planning.race import PlannerRace as PlannerRace
    from planning.validation import validate as validate

__getattr__, __dir__, __all__ = lazy_exports(
    __name__,
    {
        "CachingPlanner": "cache",
        "Executive": "executive",
        "Plan": "plan",
        "PlanStep": "plan",
        "Planner": "planner",
        "PlannerProcess": "planner",
        "PlannerRace": "race",
        "PlanningAction": "domain",
        "PlanningDomain": "domain",
        "plot_from_plan": "plot",
        "pose": "problem",
        "validate": "validation",
    },
)
