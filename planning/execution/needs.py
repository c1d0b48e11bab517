"""What the steps that are left of a plan need of the present, and which of them needs it first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from knowledge_base.language.effect import substitute_effect
from knowledge_base.language.expression import Expression
from planning.domain import PlanningDomain
from planning.execution.regression import UnregressableError, conjuncts, leaves, regressed
from planning.plan import PlanStep


class Needs:
    """The causal links of a plan's steps from the present, by regression.

    Args:
        steps: the plan's steps; they are spoken of by their number, from 1.
        domain: has their conditions and effects.
        goal: what they are for; it counts as the user after the last step.

    Raises:
        InputError: a step names no action of the domain.
    """

    def __init__(self, steps: Sequence[PlanStep], domain: PlanningDomain, goal: Expression) -> None:
        self._goal = len(steps) + 1
        self._preconditions = [conjuncts(domain.precondition(step)) for step in steps]
        self._changes = [leaves(substitute_effect(domain.action(step).effect, domain.bindings(step))) for step in steps]
        self._found: dict[tuple[int, ...], Mapping[Expression, int] | None] = {
            (): MappingProxyType(dict.fromkeys(conjuncts(goal), self._goal))
        }

    def before(self, left: tuple[int, ...]) -> Mapping[Expression, int] | None:
        """Conditions that hold now exactly if the steps with these numbers, in this order, lead to the goal.

        Each with the number of the first step that needs it (the goal's is one more than the last step's).
        `None` if what is needed cannot be written as a condition, see `UnregressableError`.
        """
        for cut in range(len(left) - 1, -1, -1):  # not by recursion: a plan may be long
            if left[cut:] not in self._found:
                self._found[left[cut:]] = self._prepended(left[cut], self._found[left[cut + 1 :]])
        return self._found[left]

    def _prepended(self, step: int, after: Mapping[Expression, int] | None) -> Mapping[Expression, int] | None:
        if after is None:
            return None
        needed: dict[Expression, int] = dict.fromkeys(self._preconditions[step - 1], step)
        try:
            for condition, user in after.items():
                for part in conjuncts(regressed(condition, self._changes[step - 1])):
                    needed.setdefault(part, user)
        except UnregressableError:
            return None
        return MappingProxyType(needed)
