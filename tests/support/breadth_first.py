"""A planner small enough to be trusted: breadth-first search over the posed problem; the shortest plan, or a proof."""

from knowledge_base import Fact
from planning.model.plan import EngineFailed, PlanFound, ProvenUnsolvable

MOST_STATES = 20_000


class BreadthFirst:
    """Remembers every problem that it was asked about."""

    def __init__(self):
        self.asked = []

    async def solve(self, problem, seconds):
        self.asked.append(problem)
        if problem.unreachable:
            return ProvenUnsolvable("breadth", "unreachable")
        start = frozenset(problem.init)
        ways: dict[frozenset[Fact], tuple[int, ...]] = {start: ()}
        agenda = [start]
        for state in agenda:
            if all(fact in state for fact in problem.goal):
                return PlanFound(problem.plan(ways[state]), "breadth", 0.0, problem.simulated_seconds)
            for number, action in enumerate(problem.actions):
                if action.applicable(state):
                    after = action.apply(state)
                    if after not in ways:
                        ways[after] = (*ways[state], number)
                        agenda.append(after)
            if len(ways) > MOST_STATES:
                return EngineFailed("breadth", "too many states")
        return ProvenUnsolvable("breadth", "all states were visited")
