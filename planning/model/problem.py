"""Planning problems as immutable values: ground STRIPS with numbers (PDDL 2.1), the input of every engine.

Facts are positive. For each condition `(not (p a))` the problem maintains the complementary fact (positive normal
form). The predicate of the complementary fact is `not p`, with a blank, so that it differs from every declared name.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from operator import itemgetter
from typing import TYPE_CHECKING

from knowledge_base.errors import InputError
from knowledge_base.facts import Fact
from knowledge_base.owner_cache import Owner
from planning.model.ground_action import GroundAction, GroundState, after, missing_condition
from planning.model.plan import Plan, Timing
from planning.model.quantities import NumericBound
from planning.model.timeline import FINEST, Flaw, execute

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence


FEATURES = ("numeric", "costs", "durations", "derived")
"""Features beyond STRIPS that a problem may need; problem construction compiles all other features away."""


class UnsupportedGoalError(InputError):
    """Error: the goal contains a construct that no engine supports; the message identifies the construct."""


class UnsupportedActionError(InputError):
    """Error: a relevant planning action contains a construct that no engine supports."""


@dataclass(frozen=True, slots=True)
class WrongPlan:
    """A plan that does not lead to the goal, with the reason for the planner that returned it.

    Attributes:
        plan: the plan.
        reason: the first step that is not applicable, with the condition that it needs, or the violated goal.
    """

    plan: Plan
    reason: str


@dataclass(frozen=True)
class Problem(Owner):
    """The input of an engine, made by `planning.problem.construction.build_problem`.

    Attributes:
        domain: the name of the planning domain.
        objects: the type of each object, by the object's name.
        init: the relevant facts that hold initially.
        goal: the facts that must hold at the end; empty if the goal already holds.
        actions: the ground actions that can contribute to the goal.
        unreachable: goal facts, as text, that are unreachable even without deletes. If there are such facts, the
            problem is proven unsolvable without an engine.
        unsliced: constructs `whole`; `None` if no object was removed.
        numbers: the initial values of the relevant numeric fluents.
        bounds: numeric conditions that must hold at the end.
        notes: requests that no engine supports, e.g. a metric; text for users.
        one_at_a_time: whether the problem treats durative actions as instantaneous ones. Then a missing plan is not
            a proof of unsolvability.
        timed: the problem with durations, for a temporal engine, if `one_at_a_time` is true; otherwise `None`.
        wrong: plans that the planner has returned for this problem before, and that do not lead to the goal.
    """

    domain: str
    objects: Mapping[str, str]
    init: tuple[Fact, ...]
    goal: tuple[Fact, ...]
    actions: tuple[GroundAction, ...]
    unreachable: tuple[str, ...] = ()
    unsliced: Callable[[], Problem] | None = field(default=None, compare=False)
    numbers: Mapping[Fact, float] = field(default_factory=dict)
    bounds: tuple[NumericBound, ...] = ()
    notes: tuple[str, ...] = ()
    one_at_a_time: bool = False
    timed: Problem | None = None
    wrong: tuple[WrongPlan, ...] = ()

    @property
    def whole(self) -> Problem | None:
        """The problem with all interchangeable objects, for use if the slice has no plan.

        Each access constructs the problem; the value is `None` if no object was removed.
        """
        return None if self.unsliced is None else self.unsliced()

    @cached_property
    def features(self) -> frozenset[str]:
        """The features that an engine must support beyond STRIPS: a subset of `FEATURES`.

        An engine without support for `costs` still solves the problem, but its plan may be expensive.
        """
        costs = {action.cost for action in self.actions if action.step is not None}
        numeric = bool(self.bounds) or any(action.is_numeric for action in self.actions)
        durative = any(action.span is not None for action in self.actions)
        needs = {"costs": len(costs) > 1, "numeric": numeric, "durations": durative}
        return frozenset(feature for feature, needed in needs.items() if needed)

    def cost(self, chosen: Iterable[int]) -> float:
        """Return the total cost of the actions with these indices."""
        return sum(self.actions[index].cost for index in chosen)

    @property
    def simulated_seconds(self) -> float:
        """The planning duration in simulated time, computed from the size of the problem and never from a clock.

        The duration is 0.1 s for construction, 1 ms for each ground action and 20 ms for each goal fact. The embedded
        engine needs time of this order of magnitude.
        """
        return round(0.1 + 0.001 * len(self.actions) + 0.02 * len(self.goal), 3)

    def plan(self, chosen: Sequence[int]) -> Plan | str:
        """Return the plan of the actions with these indices, or the reason why the actions are not a solution."""
        state, numbers = frozenset(self.init), self.numbers
        for index in chosen:
            if not 0 <= index < len(self.actions):
                return f"there is no action number {index}"
            action = self.actions[index]
            missing = action.lacks(state, numbers)
            if missing is not None:
                return f"{action.step} is not applicable, {missing} does not hold"
            try:
                state, numbers = action.apply(state), action.count(numbers)
            except ArithmeticError as error:
                return f"the effect of {action.step} cannot be computed: {error}"
        missing = missing_condition(self.goal, self.bounds, state, numbers)
        if missing is not None:
            return f"goal fact {missing} does not hold at the end"
        return self.taking(chosen)

    def taking(self, chosen: Iterable[int]) -> Plan:
        """Return the plan of the actions with these indices, without bookkeeping actions."""
        steps = (self.actions[index].step for index in chosen)
        return Plan(tuple(step for step in steps if step is not None))

    def scheduled(self, chosen: Sequence[tuple[int, float, float]]) -> Plan | str:
        """Return the plan with a schedule, or the reason why the plan is invalid.

        Args:
            chosen: index, start and duration of each action; times in seconds.
        """
        chosen = sorted(chosen, key=itemgetter(1))
        acts = []
        for index, start, seconds in chosen:
            if not 0 <= index < len(self.actions):
                return f"there is no action number {index}"
            action = self.actions[index]
            least, most = (action.span.least, action.span.most) if action.span else (0.0, 0.0)
            if not least - FINEST <= seconds <= most + FINEST:
                return f"{action.step} takes {seconds:g} s, which is not between {least:g} and {most:g}"
            acts.append(action.act(Timing(start, seconds)))
        try:
            state = execute(acts, GroundState(frozenset(self.init), self.numbers), after)
        except ArithmeticError as error:
            return f"an effect cannot be computed: {error}"
        if isinstance(state, Flaw):
            return f"{self.actions[chosen[state.act][0]].step} needs {state.why}"
        missing = missing_condition(self.goal, self.bounds, *state)
        if missing is not None:
            return f"goal fact {missing} does not hold at the end"
        steps = [(self.actions[index].step, act.timing) for (index, _, _), act in zip(chosen, acts, strict=True)]
        return Plan(
            tuple(step for step, _ in steps if step is not None),
            tuple(timing for step, timing in steps if step is not None),
        )
