"""Few chains for a partial order: as few as there are steps of which none comes before another (Dilworth)."""

from itertools import combinations, pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from planning.model.plan import PlanStep
from planning.ordering.partial_order import PartialOrder, chains


def nobody(_first, _second):
    return False


@st.composite
def orders(draw):
    size = draw(st.integers(0, 8))
    pairs = draw(st.sets(st.sampled_from(list(combinations(range(1, size + 1), 2)) or [(1, 2)]), max_size=2 * size))
    steps = tuple(PlanStep(f"s{number}") for number in range(1, size + 1))
    return PartialOrder(steps).restricted(pairs if size > 1 else ())


def is_antichain(numbers, earlier):
    return not any(first in earlier[second] for first, second in combinations(sorted(numbers), 2))


@settings(derandomize=True, deadline=None)
@given(orders())
def test_there_are_as_many_chains_as_the_largest_antichain_has_steps(order):
    found, numbers = chains(order.earlier, nobody), range(1, len(order.steps) + 1)
    assert sorted(number for chain in found for number in chain) == list(numbers)
    assert all(first in order.earlier[second] for chain in found for first, second in pairwise(chain))
    antichains = [c for size in numbers for c in combinations(numbers, size) if is_antichain(c, order.earlier)]
    assert len(found) == max(map(len, antichains), default=0)


def test_kin_stay_together():
    robot = {1: "anna", 2: "bert", 3: "bert", 4: "anna", 5: "anna", 6: "bert"}
    pairs = {(a, b) for a, b in combinations(robot, 2) if robot[a] == robot[b]} | {(1, 3), (2, 4), (4, 6)}
    order = PartialOrder(tuple(PlanStep(name) for name in robot.values())).restricted(pairs)
    assert chains(order.earlier, lambda a, b: robot[a] == robot[b]) == ((1, 4, 5), (2, 3, 6))


def test_kin_are_parted_where_that_takes_fewer_chains():
    order = PartialOrder(tuple(map(PlanStep, "abcd"))).restricted({(1, 3), (1, 4), (2, 3)})
    assert chains(order.earlier, lambda a, b: (a, b) == (1, 3)) == ((1, 4), (2, 3))
