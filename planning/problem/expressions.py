"""Functions on planning actions: the names that they change, their conditions, and replacement of these conditions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from knowledge_base.language.syntax import effect as eff
from knowledge_base.language.syntax.expression import Expression
from planning.model.domain import PlanningAction


def conditions_of(action: PlanningAction) -> tuple[Expression, ...]:
    """Return the precondition of the action and the conditions of its conditional effects."""
    return (action.precondition, *eff.effect_conditions(action.effect))


def name_of(leaf: eff.Add | eff.Delete | eff.NumericEffect) -> str:
    """Return the predicate or function that the effect changes."""
    return leaf.call.function if isinstance(leaf, eff.NumericEffect) else leaf.atom.predicate


def changed(effect: eff.Effect) -> frozenset[str]:
    """Return the predicates and functions that an effect changes."""
    return frozenset(map(name_of, eff.effect_leaves(effect)))


def rewritten(action: PlanningAction, rewrite: Callable[[Expression], Expression]) -> PlanningAction:
    """Return the action in which `rewrite` has replaced each condition."""
    timed = action.timed and replace(
        action.timed,
        start=rewrite(action.timed.start),
        over_all=rewrite(action.timed.over_all),
        end=rewrite(action.timed.end),
        start_effect=_rewritten(action.timed.start_effect, rewrite),
        end_effect=_rewritten(action.timed.end_effect, rewrite),
    )
    effect = _rewritten(action.effect, rewrite)
    return replace(action, precondition=rewrite(action.precondition), effect=effect, timed=timed)


def _rewritten(effect: eff.Effect, rewrite: Callable[[Expression], Expression]) -> eff.Effect:
    match effect:
        case eff.AllOf(parts):
            return replace(effect, parts=tuple(_rewritten(part, rewrite) for part in parts))
        case eff.ForEach(_, body):
            return replace(effect, effect=_rewritten(body, rewrite))
        case eff.When(condition, body):
            return replace(effect, condition=rewrite(condition), effect=_rewritten(body, rewrite))
        case _:
            return effect
