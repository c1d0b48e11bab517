"""Rules that lead out of a plan: the way on in the plot that holds the goal (S1.4).

    clear --then.wash--> wash        on: dirty, of: stack, do: {then: wash}

Beside the steps of a plan there is no state to go to. The generated plot ends with an outcome that says where to go; it
passes the plot `achieve` by and reaches the state with the goal, which is left with all that goes on inside.

As often as the state's budget allows new plans, until the goal has been reached: rules that lead away again and again
would keep a plot busy for ever. Then it is as if the planner had given up: for the state itself, or for the next one
around it that answers for that. Of the latter the state makes known inside the plot that it has come to that.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, MutableMapping, Sequence

from dsc.dynamic.added import Added
from dsc.dynamic.responses import because
from dsc.events import DONE, GAVE_UP
from dsc.model.actions import Assign, Emit
from dsc.model.rules import Rule
from dsc.model.states import DynamicState
from dsc.model.transitions import Transition
from knowledge_base.language.expression import Arithmetic, Comparison, Constant, Variable

Ways = Mapping[str, tuple[Transition, ...]]
"""Event -> transitions, tried in order."""


def led_away(
    name: str,
    state: DynamicState,
    on: Ways,
    beside: Container[str],
    rules: Iterable[Rule],
    added: Added,
    given_up: MutableMapping[str, str],
) -> Ways:
    """The ways out of a state with a goal, with those of rules that leave its plans.

    Args:
        name: the state's name.
        state: has the budget.
        on: its ways out so far.
        beside: the states of its scope.
        rules: those that may answer for steps of plans.
        added: gives names to what is added.
        given_up: is told the events by which the state makes known that it has given up, and why; for `answered`.
    """
    leading = {rule.outcome: rule for rule in rules if rule.leads_away and rule.then in beside}
    if not leading:
        return on
    counter = added.variable(f"left_{name}", "number", 0)
    ways = {**on, DONE: tuple(_counting_anew(way, counter) for way in on.get(DONE, ()))}
    own = on.get(GAVE_UP, ())
    for event, rule in leading.items():
        most = state.budget.replans
        reason = f"the budget of {most} new plans is used up: rules have led to '{rule.then}' once more"
        ways[event] = (_way(rule, counter, most), *(because(reason, way) for way in own))
        if not _settles(own):
            said = added.event(f"{GAVE_UP}_{name}_{rule.then}")
            given_up[said] = reason
            ways[event] += (Transition(do=(Emit(emit=said),)),)
    return ways


def answered(on: Ways, given_up: MutableMapping[str, str]) -> Ways:
    """The ways out of a state, with those for what states inside it make known; what it settles is taken away."""
    own = on.get(GAVE_UP, ())
    if not (own and given_up):
        return on
    ways = {**on, **{said: tuple(because(reason, way) for way in own) for said, reason in given_up.items()}}
    if _settles(own):
        given_up.clear()
    return ways


def _settles(ways: Sequence[Transition]) -> bool:
    return bool(ways) and ways[-1].guard is None


def _way(rule: Rule, counter: str, most: int) -> Transition:
    left = Variable(counter)
    return Transition(
        target=rule.then,
        guard=Comparison("<=", left, Constant(most)),
        do=(Assign(assign={counter: Arithmetic("+", (left, Constant(1)))}),),
        passed={name: Variable(f"event.{name}") for name in rule.do.passed},
    )


def _counting_anew(way: Transition, counter: str) -> Transition:
    return way.model_copy(update={"do": (Assign(assign={counter: Constant(0)}), *way.do)})
