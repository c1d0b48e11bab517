"""Search by the book, for problems small enough, without an engine."""

from __future__ import annotations

import heapq
import itertools
from collections import deque
from typing import Any


def breadth_first(problem, most=20_000):
    """A shortest sequence of action numbers, or None."""
    agenda: deque[tuple[Any, tuple[int, ...]]] = deque([(_start(problem), ())])
    seen = {_key(*_start(problem))}
    while agenda:
        (state, numbers), taken = agenda.popleft()
        if _reached(problem, state, numbers):
            return taken
        for number, after in _successors(problem, state, numbers):
            if _key(*after) not in seen:
                assert len(seen) < most, "too large to search through"
                seen.add(_key(*after))
                agenda.append((after, (*taken, number)))
    return None


def cheapest(problem, most=20_000):
    """A cheapest sequence of action numbers, or None (Dijkstra)."""
    counter = itertools.count()
    agenda, seen = [(0.0, next(counter), _start(problem), ())], set()
    while agenda:
        cost, _, (state, numbers), taken = heapq.heappop(agenda)
        if _reached(problem, state, numbers):
            return taken
        if _key(state, numbers) in seen:
            continue
        seen.add(_key(state, numbers))
        assert len(seen) < most, "too large to search through"
        for number, after in _successors(problem, state, numbers):
            heapq.heappush(agenda, (cost + problem.actions[number].cost, next(counter), after, (*taken, number)))
    return None


def solution(problem, search=breadth_first):
    """A plan for the slice or else the whole, as a planner would find one."""
    if problem.unreachable:
        return None
    chosen = search(problem)
    if chosen is not None:
        return problem.plan(chosen)
    return None if problem.whole is None else solution(problem.whole, search)


def _start(problem):
    return frozenset(problem.init), dict(problem.numbers)


def _key(state, numbers):
    return state, tuple(sorted((str(fluent), number) for fluent, number in numbers.items()))


def _reached(problem, state, numbers):
    return all(one in state for one in problem.goal) and all(bound.holds(numbers) for bound in problem.bounds)


def _successors(problem, state, numbers):
    for number, action in enumerate(problem.actions):
        if action.applicable(state, numbers):
            yield number, (action.apply(state), action.count(numbers))
