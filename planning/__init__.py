"""Planning: from a goal to a plan, from a plan to an action plot, and to a new plan when the world changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from planning.bundles import Bundle as Bundle
    from planning.domain import PlanningAction as PlanningAction
    from planning.domain import PlanningDomain as PlanningDomain
    from planning.engines.cache import CachingPlanner as CachingPlanner
    from planning.engines.planner import Planner as Planner
    from planning.engines.planner import PlannerProcess as PlannerProcess
    from planning.engines.race import PlannerRace as PlannerRace
    from planning.execution.plan_records import why_broken as why_broken
    from planning.executive import Executive as Executive
    from planning.executive import achieve_plot as achieve_plot
    from planning.generation.plan_to_plot import plot_from_plan as plot_from_plan
    from planning.ordering.partial_order import deordered as deordered
    from planning.ordering.purposes import why as why
    from planning.plan import EngineFailed as EngineFailed
    from planning.plan import NoneFound as NoneFound
    from planning.plan import Plan as Plan
    from planning.plan import PlanFound as PlanFound
    from planning.plan import PlanStep as PlanStep
    from planning.plan import ProvenUnsolvable as ProvenUnsolvable
    from planning.plan import TimedOut as TimedOut
    from planning.plan import Timing as Timing
    from planning.problem.construction import build_problem as build_problem
    from planning.unified import from_unified as from_unified
    from planning.unified import to_unified as to_unified
    from planning.unsupported import UnsupportedActionError as UnsupportedActionError
    from planning.unsupported import UnsupportedGoalError as UnsupportedGoalError
    from planning.validation import Validation as Validation
    from planning.validation import validate as validate

__getattr__, __dir__, __all__ = lazy_exports(
    __name__,
    {
        "Bundle": "bundles",
        "CachingPlanner": "engines.cache",
        "EngineFailed": "plan",
        "Executive": "executive",
        "NoneFound": "plan",
        "Plan": "plan",
        "PlanFound": "plan",
        "PlanStep": "plan",
        "Planner": "engines.planner",
        "PlannerProcess": "engines.planner",
        "PlannerRace": "engines.race",
        "PlanningAction": "domain",
        "PlanningDomain": "domain",
        "ProvenUnsolvable": "plan",
        "TimedOut": "plan",
        "Timing": "plan",
        "UnsupportedActionError": "unsupported",
        "UnsupportedGoalError": "unsupported",
        "Validation": "validation",
        "achieve_plot": "executive",
        "build_problem": "problem.construction",
        "deordered": "ordering.partial_order",
        "from_unified": "unified",
        "plot_from_plan": "generation.plan_to_plot",
        "to_unified": "unified",
        "validate": "validation",
        "why": "ordering.purposes",
        "why_broken": "execution.plan_records",
    },
)
