"""Ends of a plan that lead from a world to the goal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from knowledge_base.errors import InputError
from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.world.overlay import Overlay
from planning.model.domain import PlanningDomain
from planning.model.plan import PlanStep
from planning.ordering.known_steps import KnownStep, changed_names, literal_of
from planning.ordering.step_dependencies import ground_conjuncts
from planning.problem.conditions import Literal


def leads_to(steps: Iterable[PlanStep], domain: PlanningDomain, world: World, goal: Expression) -> bool:
    """Return whether the steps, executed in this order from `world`, reach the goal; `world` stays unchanged."""
    ahead: Overlay | None = None  # made on demand, since most ends of a plan fail at their first step
    try:
        for step in steps:
            if not domain.applicable(step, ahead or world):
                return False
            ahead = ahead or Overlay(world)
            ahead.apply(domain.effects(step, ahead))
        return holds(goal, ahead or world)
    except InputError:  # an object is missing, or a value cannot be computed
        return False


def shortest_end(
    steps: Sequence[PlanStep], domain: PlanningDomain, world: World, goal: Expression
) -> tuple[PlanStep, ...] | None:
    """Return the fewest last steps that lead from `world` to the goal; `None` if not even all steps do.

    The literals that an end needs are computed from the end before it. Only ends whose literals are true are simulated.
    """
    needs = _Needs(domain, world, goal)
    for first in range(len(steps), -1, -1):
        if first < len(steps) and not needs.prepend(steps[first]):
            return None
        if not needs.unmet and leads_to(steps[first:], domain, world, goal):
            return tuple(steps[first:])
    return None


class _Needs:
    """Necessary conditions for an end of a plan: literals, without conditions of other forms.

    Attributes:
        unmet: the facts whose truth in the world differs from the one that the end needs.
    """

    def __init__(self, domain: PlanningDomain, world: World, goal: Expression) -> None:
        self._domain = domain
        self._world = world
        self._wanted: dict[Fact, bool] = {}
        self._consistent = True
        self.unmet: set[Fact] = set()
        for part in ground_conjuncts(goal, world):
            self._want(literal_of(part, world.schema))

    def prepend(self, step: PlanStep) -> bool:
        """Add a step before the end; return whether the end may still lead to the goal, with any steps before it."""
        try:
            action, ground = self._domain.action(step), self._domain.ground(step)
        except InputError:  # `leads_to` refuses each end with this step
            return False
        known = KnownStep.of(ground, step, action, self._world.schema)
        if known.makes is None:
            names = frozenset(changed_names(action))
            for fact in [one for one in self._wanted if one.predicate in names]:
                self._forget(fact)
        else:
            for fact, so in known.changes.items():
                self._consistent &= self._wanted.get(fact, so) is so
                self._forget(fact)
        for _, literal in known.needs:
            self._want(literal)
        return self._consistent

    def _want(self, literal: Literal | None) -> None:
        if literal is None:
            return
        fact = literal.fact
        self._consistent &= self._wanted.setdefault(fact, literal.positive) is literal.positive
        if self._world.holds(fact.predicate, fact.args) is not literal.positive:
            self.unmet.add(fact)

    def _forget(self, fact: Fact) -> None:
        self._wanted.pop(fact, None)
        self.unmet.discard(fact)
