"""Plan validation: simulation of a plan, to check that the plan reaches its goal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.language.evaluation.evaluator import apply_effect, evaluate_term, holds
from knowledge_base.language.evaluation.explanation import explain
from knowledge_base.language.evaluation.terms import as_number
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.world.overlay import Overlay
from planning.model.plan import Plan
from planning.model.timeline import FINEST, Act, Changes, Flaw, TimelineEvent, execute
from planning.problem.derived import derivation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from knowledge_base.facts import Value
    from knowledge_base.language.checking.vocabulary import Vocabulary
    from knowledge_base.language.syntax.effect import Effect
    from planning.model.domain import PlanningDomain
    from planning.model.plan import PlanStep, Timing
    from planning.problem.derived import Derivation


@dataclass(frozen=True, slots=True)
class Validation:
    """Result of a plan validation.

    Attributes:
        valid: whether every step is applicable at its time and the goal holds at the end.
        failing_step: the index of the first inapplicable step; `None` if all steps are applicable.
        why: the violated condition, in PDDL; empty if the plan is valid.
        cost: the cost of a valid plan as a foresight knows it, e.g. seconds or a risk; a robot prefers the lowest.
        costliest_step: the index of the step with the largest part of the cost; alternative plans omit the step.
    """

    valid: bool
    failing_step: int | None = None
    why: str = ""
    cost: float | None = None
    costliest_step: int | None = None


def validate(plan: Plan, domain: PlanningDomain, world: World, goal: Expression) -> Validation:
    """Simulate `plan` from `world` and return the result; `world` stays unchanged.

    A plan with a schedule is simulated on a time line, see `planning.model.timeline`. A plan without one is simulated
    step by step, and its durative actions are treated as instantaneous ones. A plan is invalid if a step has an unknown
    action or object, or if the goal contains an object that no longer exists.
    """
    derived = derivation(domain)
    ahead = (_as_scheduled if plan.schedule else _in_turn)(plan, derived, derived.world(world))
    if isinstance(ahead, Validation):
        return ahead
    try:
        wanted, seen = derived.expand(goal), derived.complete(ahead) if derived.unsupported else ahead
        reached = holds(wanted, seen)
        return Validation(reached, why="" if reached else str(explain(wanted, seen).deciding))
    except InputError as error:
        return Validation(valid=False, why=str(error))


def _in_turn(plan: Plan, derived: Derivation, world: World) -> Overlay | Validation:
    """Return the world after all steps in order, or the validation with the failing step."""
    ahead = Overlay(world)
    for index, step in enumerate(plan.steps):
        seen = derived.complete(ahead) if derived.unsupported else ahead
        why_not = _obstacle(step, derived.domain, seen, ahead)
        if why_not is not None:
            return Validation(valid=False, failing_step=index, why=why_not)
    return ahead


def _as_scheduled(plan: Plan, derived: Derivation, world: World) -> Overlay | Validation:
    """Return the world after all steps at their scheduled times, or the validation with the failing step."""
    acts = []
    for index, (step, timing) in enumerate(zip(plan.steps, plan.schedule, strict=True)):
        try:
            acts.append(_act(step, timing, derived.domain, world))
        except InputError as error:
            return Validation(valid=False, failing_step=index, why=str(error))

    def after(state: Overlay, changes: Changes) -> Overlay:
        ahead = Overlay(world)  # an overlay on `state` would lead to one overlay per event
        ahead.apply(state.delta)
        ahead.apply(_delta(changes, world.schema))
        return ahead

    end = execute(acts, Overlay(world), after)
    return Validation(valid=False, failing_step=end.act, why=end.why) if isinstance(end, Flaw) else end


def _act(step: PlanStep, timing: Timing, domain: PlanningDomain, world: World) -> Act[Overlay]:
    """Return the step as an act on the time line.

    Raises:
        InputError: the step has a missing object, or the duration is outside the bounds of the action.
    """
    action, bindings = domain.action(step), domain.bindings(step)
    for parameter in action.parameters:
        arg = bindings[parameter.name]
        if not world.schema.fits(world.type_of(arg) or "", parameter.types):
            raise InputError(f"{step} is not possible: '{arg}' is no {' or '.join(parameter.types)}")
    timed, duration = action.timed, action.duration
    if timed is None or duration is None:
        return Act(timing, _event(action.precondition, action.effect, bindings))
    least, most = (
        as_number(evaluate_term(one, world, bindings), "a duration", one.place)
        for one in (duration.least, duration.most)
    )
    if not least - FINEST <= timing.duration <= most + FINEST:
        raise InputError(f"{step} takes {timing.duration:g} s, which is not between {least:g} and {most:g}")
    start, end = (
        _event(condition, effect, bindings)
        for condition, effect in ((timed.start, timed.start_effect), (timed.end, timed.end_effect))
    )
    return Act(timing, start, partial(_missing, timed.over_all, bindings), end)


def _event(condition: Expression, effect: Effect, bindings: Mapping[str, Value]) -> TimelineEvent[Overlay]:
    return TimelineEvent(partial(_missing, condition, bindings), partial(_changes, effect, bindings))


def _missing(condition: Expression, bindings: Mapping[str, Value], state: Overlay) -> str | None:
    try:
        return None if holds(condition, state, bindings) else str(explain(condition, state, bindings).deciding)
    except InputError as error:
        return str(error)


def _changes(effect: Effect, bindings: Mapping[str, Value], state: Overlay) -> Changes:
    made = apply_effect(effect, state, bindings)
    return {**dict.fromkeys(made.removed, False), **dict.fromkeys(made.added, True), **made.values}


def _delta(changes: Changes, schema: Vocabulary) -> Delta:
    facts = {one: so for one, so in changes.items() if one.predicate in schema.predicates}
    return Delta(
        added=tuple(one for one, so in facts.items() if so),
        removed=tuple(one for one, so in facts.items() if not so),
        values={one: number for one, number in changes.items() if one not in facts},
    )


def _obstacle(step: PlanStep, domain: PlanningDomain, seen: World, ahead: Overlay) -> str | None:
    """Apply the step to `ahead`, or return why the step is not applicable.

    `seen` is the world `ahead` with all derived facts.
    """
    try:
        if not domain.applicable(step, seen):
            return str(domain.why_not(step, seen).deciding)
        ahead.apply(domain.effects(step, seen))
    except InputError as error:
        return str(error)
    return None
