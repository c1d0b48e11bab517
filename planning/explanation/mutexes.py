"""Mutexes: pairs of facts that never hold together, by the critical path heuristic h² (Haslum & Geffner 2000)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from knowledge_base.facts import Fact
    from planning.cancellable_work import WorkLimit
    from planning.strips import Problem


@dataclass(frozen=True, slots=True)
class _NumberedAction:
    """A ground action with facts as numbers; sets of facts are bits."""

    needs: tuple[int, ...]
    needed: int
    adds: tuple[int, ...]
    added: int
    kept: int


def goal_mutexes(problem: Problem, patience: WorkLimit) -> Iterator[tuple[Fact, Fact]]:
    """The pairs of goal facts that never hold together, though each may by itself.

    Raises:
        WorkLimitError: it takes too long.
    """
    number = {fact: i for i, fact in enumerate(dict.fromkeys([*problem.init, *problem.goal, *_mentioned(problem)]))}
    actions = []
    for action in problem.actions:
        adds, deletes = ([number[fact] for fact in facts] for facts in (action.adds, action.deletes))
        needs = tuple(number[fact] for fact in action.precondition)
        actions.append(_NumberedAction(needs, _bits(needs), tuple(adds), _bits(adds), ~(_bits(adds) | _bits(deletes))))
    together = _reached(actions, [number[fact] for fact in problem.init], len(number), patience)
    for one, other in itertools.combinations(problem.goal, 2):
        if not together[number[one]] >> number[other] & 1:
            yield one, other


def _mentioned(problem: Problem) -> Iterator[Fact]:
    for action in problem.actions:
        yield from action.facts()


def _bits(numbers: Iterable[int]) -> int:
    found = 0
    for number in numbers:
        found |= 1 << number
    return found


def _reached(actions: list[_NumberedAction], init: list[int], size: int, patience: WorkLimit) -> list[int]:
    """For each fact the facts that can hold together with it, as bits; itself included if it can hold at all."""
    possible = _bits(init)
    together = [possible if possible >> i & 1 else 0 for i in range(size)]
    before: list[int] = []
    while before != together:
        before = together.copy()
        for action in actions:
            patience.spend()
            if any(action.needed & ~together[need] for need in action.needs):
                continue
            beside = action.kept & possible
            for need in action.needs:
                beside &= together[need]
            for one in action.adds:
                fresh = (beside | action.added) & ~together[one]
                together[one] |= fresh
                _mirror(one, fresh, together)
            possible |= action.added
    return together


def _mirror(one: int, fresh: int, together: list[int]) -> None:
    while fresh:
        lowest = fresh & -fresh
        together[lowest.bit_length() - 1] |= 1 << one
        fresh ^= lowest
