"""pyperplan on its own terms: its ground task is written straight from our ground problem.

Through unified-planning the problem would be made twice more on the way, as that library's and then as one with
parameters for pyperplan to ground, which takes several times as long as the search on all but the hardest problems.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pyperplan.heuristics.relaxation import hFFHeuristic
from pyperplan.search.a_star import greedy_best_first_search
from pyperplan.task import Operator, Task

if TYPE_CHECKING:
    from collections.abc import Iterable

    from planning.engines.registry import Engine
    from planning.engines.worker import Answers, Request, Search


def searching(engine: Engine) -> Search:  # noqa: ARG001
    """Greedy best-first search with h_FF, for `planning.engines.worker`."""

    def search(request: Request) -> Answers:
        return _plans(task(request))

    return search


def task(request: Request) -> Task:
    """The problem as pyperplan's; actions are called by their numbers.

    pyperplan breaks ties by the order of its sets, that is by the hashes of names: with fixed ones (PYTHONHASHSEED)
    the same problem gets the same plan.
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


def _plans(posed: Task) -> Answers:
    # Every state is visited, except those that h_FF finds hopeless even without deletions: an exhausted search is a
    # proof.
    found = greedy_best_first_search(posed, hFFHeuristic(posed))
    yield None if found is None else [operator.name for operator in found]
