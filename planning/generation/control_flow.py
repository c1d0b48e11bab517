r"""Control flows of a generated plot: sequences of steps, some of which wait for steps of other flows.

        before_3 -> step_3 -> after_3 -> before_5 -> step_5 -> after_5 -> finished_1
               \-> replan_1, if a condition of a step does not hold

- `after_n` waits until the effects of step n are observed.
- `before_n` waits for steps of other flows, which set the variables `done_m` and `begun_m`, and then tests the
  conditions of step n. No step therefore begins with a false precondition. If step n need not wait for other flows,
  the previous `after` state tests the conditions of step n.
- A step that is running in the plot that this plot replaces continues in its state, which both plots have. If the step
  has ended in the meantime, `before_n` leads to `after_n`.
- A step that the planning component withdraws ends its chain, and parallel chains continue.
- The state `step_n_again` exists if rules may enter step n again. It tests the conditions of the step.
- The state `step_n_skipped` exists if rules may skip step n. It replaces `after_n` and does not wait for effects.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dsc.dynamic.responses import again, skipped
from dsc.events import GAVE_UP
from dsc.model.rules import REPLAN
from knowledge_base.language.syntax.expression import And, Comparison, Constant, Expression, Not, Or, Variable
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.text import to_text
from knowledge_base.owner_cache import cache_on_owner
from planning.generation.carried_steps import CarriedStep
from planning.ordering.partial_order import PartialOrder

FINISHED = "finished"
NOT_OBSERVED = "not observed: "
"""Beginning of the reason if the effects of a step do not hold in time."""
_DONE, _BEGUN = "done", "begun"


@dataclass(frozen=True, slots=True)
class ControlFlow:
    """A chain of steps; `mark` is the suffix of its end states, so that their names are unique in the plot."""

    numbers: tuple[int, ...]
    mark: str = ""
    name: str = ""

    @property
    def finished(self) -> str:
        """The name of the end state of the chain."""
        return FINISHED + self.mark


class Writer:
    """Writer of the states of all chains of one plot.

    Args:
        steps: all steps of the plan by their numbers.
        order: the partial order of the steps.
        lanes: the chains of steps.
        plan: the name of the plan, with which states report the begin of steps; `None` without the planning component.
        omitted: the numbers of the steps that rules may skip.
        leading: outcomes with which rules leave the plan for another state; for each, the names of the passed data.
        retried: whether rules may enter steps again.
        running: the steps that are running in the plot that this plot replaces.
    """

    def __init__(
        self,
        steps: Mapping[int, CarriedStep],
        order: PartialOrder,
        lanes: Sequence[ControlFlow],
        plan: str | None,
        omitted: Collection[int],
        leading: Mapping[str, Iterable[str]],
        *,
        retried: bool,
        running: Collection[int] = (),
    ) -> None:
        self._retried = retried
        self._running = frozenset(running)
        self._steps = steps
        self._omitted = omitted
        self._ends: dict[str, Mapping[str, str]] = {end: {"reason": "?reason"} for end in (REPLAN, GAVE_UP)}
        self._ends.update({end: {name: f"?{passed(name)}" for name in names} for end, names in leading.items()})
        self._plan = plan
        lane_of = {number: lane for lane in lanes for number in lane.numbers}
        self._waits: dict[int, list[tuple[str, int]]] = {number: [] for number in self._steps}
        for kind, pairs in ((_DONE, order.before), (_BEGUN, order.begin_before)):
            for first, second in sorted(pairs):
                if lane_of[first] is not lane_of[second]:
                    self._waits[second].append((kind, first))
        self._flags = dict.fromkeys(f"{kind}_{first}" for waits in self._waits.values() for kind, first in waits)

    @property
    def variables(self) -> Mapping[str, Any]:
        """The variables by which chains wait for each other."""
        return {flag: {"type": "boolean", "initial": False} for flag in self._flags}

    def states(self, lane: ControlFlow) -> dict[str, Any]:
        """Return the states of one chain, without its state `finished`."""
        first = lane.numbers[0] if lane.numbers else None
        states: dict[str, Any] = {"before" if first is None else f"before_{first}": self._before(first, lane)}
        for number, following in zip(lane.numbers, (*lane.numbers[1:], None), strict=False):
            states[f"step_{number}"] = self._step(number, lane)
            if self._retried and self._steps[number].needed:
                states[again(f"step_{number}")] = self._again(number, lane)
            states[f"after_{number}"] = self._after(number, following, lane)
            if number in self._omitted:
                states[skipped(f"step_{number}")] = self._after(number, following, lane, omitted=True)
            if following is not None and self._waits[following]:
                states[f"before_{following}"] = self._before(following, lane)
        for end, handed_out in self._ends.items():
            states[end + lane.mark] = {"final": True, "emit": end, "with": handed_out}
        return states

    def _before(self, number: int | None, lane: ControlFlow) -> dict[str, Any]:
        if number is None:
            return {"always": self._onward(number, lane, ())}
        waits = self._waits[number]
        told = {"about": "waits for " + ", ".join(self._steps[other].text for _, other in waits)} if waits else {}
        ended = []
        if number in self._running and (seen := _seen(self._steps[number])) is not None:
            ended = [_add_guard({"to": f"after_{number}"}, seen)]
        return {**told, "always": [*ended, *self._onward(number, lane, [self._is_over(*one) for one in waits])]}

    def _is_over(self, kind: str, number: int) -> Expression:
        """Return the condition under which a chain no longer waits for a step.

        Effects of a step that was running before this plot also count, since it may have ended before its chain began.
        """
        seen = _seen(self._steps[number]) if number in self._running and kind == _DONE else None
        return _is_set(kind, number) if seen is None else Or((_is_set(kind, number), seen))

    def _again(self, number: int, lane: ControlFlow) -> dict[str, Any]:
        """Return the state through which rules enter a step again."""
        step = self._steps[number]
        enter = _add_guard({"to": f"step_{number}"}, _join(step.needed))
        return {"always": [enter, self._replan(lane, f"not applicable: {step.text}")]}

    def _step(self, number: int, lane: ControlFlow) -> dict[str, Any]:
        step = self._steps[number]
        done = {"to": f"after_{number}", **({"tell": step.effect} if step.assumed else {})}
        state: dict[str, Any] = {"about": step.text, **step.content, "on": {"done": done}}
        if self._plan is not None:
            arguments = {"plan": self._plan, "step": number}
            listen = {"trigger": "planner.hold", "with": arguments}
            state["entry"] = [{"set": f"planner.{self._plan}", "to": number}, listen]
            if lane.mark:
                state["on"]["withdrawn"] = {"to": lane.finished}
        if step.over_all:
            state["always"] = [
                self._replan(lane, f"lost during {step.text}: {to_text(one)}", Not(one)) for one in step.over_all
            ]
        if step.seconds is not None:
            state["after"] = {"seconds": step.seconds, **self._replan(lane, f"too slow: {step.text}")}
        return state

    def _after(self, number: int, following: int | None, lane: ControlFlow, *, omitted: bool = False) -> dict[str, Any]:
        step, flag = self._steps[number], f"{_DONE}_{number}"
        told = {"assign": {flag: True}} if flag in self._flags else {}
        if following is not None and self._waits[following]:
            onward = [_add_guard({"to": f"before_{following}", **told}, None if omitted else _seen(step))]
        elif omitted:
            onward = self._onward(following, lane, (), told)
        else:
            onward = self._onward(following, lane, step.expected, told, step)
        state: dict[str, Any] = {"always": onward}
        if step.expected and not omitted:
            state["after"] = {"seconds": step.confirm, **self._replan(lane, f"{NOT_OBSERVED}{step.text}")}
        return state

    def _onward(
        self, number: int | None, lane: ControlFlow, first: Iterable[Expression], told: Mapping[str, Any] | None = None,
        after: CarriedStep | None = None,
    ) -> list[dict[str, Any]]:  # fmt: skip
        """Return transitions to a step if it is applicable, and otherwise to `replan`.

        All transitions wait for the conditions in `first`, or for the expected effects of `after` if that is given.
        """
        first, assigned = tuple(first), dict((told or {}).get("assign", {}))
        begun = _join(first) if after is None else _seen(after)
        if number is None:
            return [_add_guard({"to": lane.finished, **(told or {})}, begun)]
        step, flag = self._steps[number], f"{_BEGUN}_{number}"
        if flag in self._flags:
            assigned[flag] = True
        begin = {"to": f"step_{number}", **({"assign": assigned} if assigned else {})}
        both = _join((*first, *step.needed)) if after is None else _between(after, step)
        otherwise = [] if both == begun else [self._replan(lane, f"not applicable: {step.text}", begun)]
        return [_add_guard(begin, both), *otherwise]

    def _replan(self, lane: ControlFlow, reason: str, when: Expression | None = None) -> dict[str, Any]:
        return _add_guard({"to": REPLAN + lane.mark, "assign": {"reason": reason}}, when)


def passed(name: str) -> str:
    """Return the name of the variable for data that a rule passes to a state outside the plan."""
    return f"passed_{name}"


def _add_guard(transition: dict[str, Any], when: Expression | None) -> dict[str, Any]:
    return transition if when is None else {**transition, "when": when}


def _join(conditions: Iterable[Expression]) -> Expression | None:
    """Return the conjunction of the conditions; `None` without conditions."""
    all_ = tuple(dict.fromkeys(conditions))
    return None if not all_ else all_[0] if len(all_) == 1 else And(all_)


# Equal pairs of steps must have identical conditions, because other caches use the identity of a condition as the key.
_pairs: IdentityCache[CarriedStep, tuple[Expression | None]] = IdentityCache(size=1024)


@cache_on_owner
def _seen(step: CarriedStep) -> Expression | None:
    """Return the conjunction of the expected effects of a step."""
    return _join(step.expected)


def _between(step: CarriedStep, following: CarriedStep) -> Expression | None:
    """Return the conjunction of the expected effects of a step and the conditions of the next step; cached."""
    both = (*step.expected, *following.needed)
    (found,) = _pairs.find(step, following) or _pairs.keep(step, following, (_join(both),))
    return found


def _is_set(kind: str, number: int) -> Expression:
    return Comparison("=", Variable(f"{kind}_{number}"), Constant(value=True))
