"""Action elimination (Nakhost & Müller 2010): remove redundant steps from a plan.

The first plan of an engine often contains detours, and a robot would execute each redundant step. Each trial removes
one action and all later actions that are then inapplicable. The removal is kept if the plan still reaches the goal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from knowledge_base.facts import Fact
    from planning.model.ground_action import GroundAction
    from planning.model.problem import Problem
    from planning.model.quantities import Numbers


@dataclass(frozen=True, slots=True)
class _Act:
    """A ground action whose sets of facts are integers with one bit per fact, so that a trial takes a microsecond."""

    index: int
    action: GroundAction
    needs: int
    adds: int
    keeps: int


@dataclass(frozen=True, slots=True)
class _State:
    facts: int
    numbers: Numbers

    def after(self, act: _Act) -> _State | None:
        """Return the state after the action; `None` if the action is not applicable."""
        if act.needs & ~self.facts:
            return None
        action, numbers = act.action, self.numbers
        if action.bounds and not all(bound.holds(numbers) for bound in action.bounds):
            return None
        if action.assignments:
            try:
                numbers = action.count(numbers)
            except ArithmeticError:
                return None
        return _State(self.facts & act.keeps | act.adds, numbers)


def indispensable(problem: Problem, chosen: Sequence[int]) -> list[int]:
    """Return the indices of the plan's actions without redundant actions.

    No action of the result can be removed together with the actions that depend on it.

    Args:
        problem: a problem without durations.
        chosen: the indices of the actions of a plan for the problem, in order.
    """
    acts, start, goal = _encode(problem, chosen)
    before = None
    while before != len(acts):  # a removal may make an earlier action redundant
        before = len(acts)
        acts = _once(problem, acts, start, goal)
    return [act.index for act in acts]


def _once(problem: Problem, acts: list[_Act], state: _State, goal: int) -> list[_Act]:
    """Return the actions after one trial for each action, from the first to the last."""
    position = 0
    while position < len(acts):
        fewer, end = _without(state, acts[position + 1 :])
        if not goal & ~end.facts and all(bound.holds(end.numbers) for bound in problem.bounds):
            acts = [*acts[:position], *fewer]
            continue
        state = state.after(acts[position]) or state
        position += 1
    return acts


def _without(state: _State, acts: Sequence[_Act]) -> tuple[list[_Act], _State]:
    """Return the actions that are applicable one after the other from `state`, and the state after them."""
    taken = []
    for act in acts:
        ahead = state.after(act)
        if ahead is not None:
            state = ahead
            taken.append(act)
    return taken, state


def _encode(problem: Problem, chosen: Sequence[int]) -> tuple[list[_Act], _State, int]:
    bit: dict[Fact, int] = {}

    def bits(facts: Sequence[Fact]) -> int:
        found = 0
        for fact in facts:
            found |= bit.setdefault(fact, 1 << len(bit))
        return found

    actions = [(index, problem.actions[index]) for index in chosen]
    acts = [_Act(i, one, bits(one.precondition), bits(one.adds), ~bits(one.deletes)) for i, one in actions]
    goal = bits(problem.goal)
    present = bits([fact for fact in problem.init if fact in bit])
    return acts, _State(present, problem.numbers), goal
