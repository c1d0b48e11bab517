"""Driver of pyperplan that constructs pyperplan's ground task directly from the ground problem.

A conversion by unified-planning would construct two more problems: a problem of that library, and a lifted problem that
pyperplan grounds. Except for the hardest problems, the conversion takes several times as long as the search.
"""

from __future__ import annotations

from collections.abc import Iterable

from pyperplan.heuristics.relaxation import hFFHeuristic
from pyperplan.search.a_star import greedy_best_first_search
from pyperplan.task import Operator, Task

from planning.engines.registry import Engine
from planning.engines.worker import Answers, Request, Search


def searching(engine: Engine) -> Search:  # noqa: ARG001
    """Return a greedy best-first search with the heuristic h_FF, for `planning.engines.worker`."""

    def search(request: Request) -> Answers:
        return _plans(task(request))

    return search


def task(request: Request) -> Task:
    """Return the problem as a task of pyperplan; each operator has the index of its action as name.

    pyperplan breaks ties by the order of its sets, which depends on the hashes of names. With fixed hashes
    (PYTHONHASHSEED) equal problems have equal plans.
    """
    names = [f"f{number}" for number in range(len(request["facts"]))]

    def called(facts: Iterable[int]) -> list[str]:
        return [names[number] for number in facts]

    operators = [
        Operator(number, called(needs), called(adds), called(deletes))
        for number, (_, needs, adds, deletes, *_) in enumerate(request["actions"])
    ]
    init, goal = (frozenset(called(request[part])) for part in ("init", "goal"))
    return Task("problem", set(names), init, goal, operators)


def _plans(task: Task) -> Answers:
    # The search prunes only states that are hopeless by h_FF even without deletions. An exhausted search is therefore a
    # proof of unsolvability.
    found = greedy_best_first_search(task, hFFHeuristic(task))
    yield None if found is None else [operator.name for operator in found]
