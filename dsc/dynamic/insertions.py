r"""Insertions: rules before and after steps, expanded into connectors and states (S1.4).

    -> <clean?> -> look   before: look
         \-> wipe -/

The condition of a `before` rule is evaluated at each entry into the step, from every source. The condition of an
`after` rule is evaluated at each completion.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial

from dsc.dynamic.fresh_names import FreshNames
from dsc.dynamic.responses import Onward, Responses, States, again
from dsc.dynamic.steps import Plots, Step, about_step, concerns
from dsc.events import DONE
from dsc.model.actions import Assign
from dsc.model.plot import ActionPlot
from dsc.model.rules import CONTINUE, ENTER, Rule
from dsc.model.states import AnyState, DynamicState, SubmachineState
from dsc.model.transitions import ChoiceState, Redirect, Transition, TransitionSource
from knowledge_base.errors import SchemaError
from knowledge_base.language.syntax.expression import Term


class Insertions:
    """Builder of the insertions of one plot.

    Attributes:
        entrances: the first connector before a step, by the step's name, for steps with insertions before them.
    """

    def __init__(self, plot: ActionPlot, plots: Plots, added: FreshNames, responses: Responses) -> None:
        self._plot, self._plots = plot, plots
        self._added, self._responses = added, responses
        self._steps: dict[str, Step] = {}
        self._before: dict[str, list[tuple[int, Rule]]] = {}
        self._leading: dict[str, str] = {}  # by the name of a state added before a step, the step
        self.entrances: dict[str, str] = {}
        self._placed = [(number, rule) for number, rule in enumerate(plot.rules) if rule.on is None]

    def through(self, states: Mapping[str, AnyState], written: Iterable[str]) -> States:
        """Return the states of one scope by name, with all insertions.

        Args:
            states: the states of the scope: the written states, and the states added for outcome rules.
            written: names of the written states.
        """
        if not self._placed:
            return dict(states)
        result = dict(states)
        for name in written:
            state = states[name]
            if isinstance(state, SubmachineState | DynamicState):
                self._before[name] = self._of(name, state, "before")
                self._steps[name] = state
                result.update(self._after(name, state))
        for name in [name for name, rules in self._before.items() if rules and name in states]:
            self.entrances[name] = self._in_front_of(name, {}, result)
            if again(name) in states:
                self.entrances[again(name)] = self.entrances[name]
                self._leading[again(name)] = name
        waiting = list(result)
        while waiting:
            name = waiting.pop()
            more: States = {}
            state = result[name]
            if isinstance(state, TransitionSource):
                result[name] = state.redirected(self._redirection(name, more))
            result.update(more)
            waiting += more
        return _in_order(result, states)

    def _of(self, name: str, state: Step, place: str) -> list[tuple[int, Rule]]:
        placed = [(n, one) for n, one in self._placed if one.place == place]
        found = [(n, one) for n, one in placed if concerns(one, name, state, self._plots)]
        return [(n, about_step(one, state, self._plot)) for n, one in found]

    def _after(self, name: str, state: Step) -> States:
        """Return a step whose transitions on `done` lead through its `after` rules, and the added states, by name."""
        rules = self._of(name, state, "after")
        if not rules or DONE not in state.on:
            return {name: state}
        more: States = {}
        ways = []
        for number, way in enumerate(state.on[DONE]):
            mark = f"{name}_after" + (f"_{number}" if number else "")
            ways.append(way if way.target is None else self._way(way, mark, name, state, rules, CONTINUE, more))
        return {name: state.model_copy(update={"on": {**state.on, DONE: tuple(ways)}}), **more}

    def _in_front_of(self, name: str, passed: Mapping[str, Term], states: States) -> str:
        """Add the connectors before a step to `states`; return the name of the first connector."""
        more: States = {}
        tested = again(name) in states and not passed
        last = Transition(target=again(name) if tested else name, passed=dict(passed))
        first = self._chain(f"{name}_before", name, self._steps[name], self._before[name], ENTER, last, more)
        self._leading.update(dict.fromkeys(more, name))
        states.update(more)
        return str(first.target)

    def _redirection(self, source: str, more: States) -> Redirect:
        def redirect(way: Transition) -> Mapping[str, object]:
            target = way.target
            leads_to = self._leading.get(source)
            if target not in self.entrances or (leads_to is not None and target in (leads_to, again(leads_to))):
                return {}
            if not way.passed:
                return {"target": self.entrances[target]}
            kept: dict[str, Term] = {}
            passed = self._responses.remembered(way.passed, target, kept)
            return _passing(way, self._in_front_of(target, passed, more), kept)

        return redirect

    def _way(
        self, way: Transition, mark: str, name: str, state: Step, rules: list[tuple[int, Rule]], by_default: str,
        states: States,
    ) -> Transition:  # fmt: skip
        """Return a transition that leads through insertions to its original target; add their states to `states`."""
        kept: dict[str, Term] = {}
        last = Transition(target=way.target, passed=self._responses.remembered(way.passed, mark, kept))
        first = self._chain(mark, name, state, rules, by_default, last, states)
        return way.model_copy(update=_passing(way, str(first.target), kept))

    def _chain(
        self, mark: str, name: str, state: Step, rules: list[tuple[int, Rule]], by_default: str, last: Transition,
        states: States,
    ) -> Transition:  # fmt: skip
        """Add a sequence of connectors that ends with `last` to `states`; return a transition to the first one."""
        following = last
        for number, rule in reversed(rules):
            key = f"{mark}_{number}"
            default = partial(self._default, by_default=by_default, following=following, last=last)
            onward = partial(self._onward, number=number, name=name, state=state, default=default)
            connector = self._added.state(key, f"{rule.place} {name}")
            made: States = {}
            branches = self._responses.execute(rule, name, key, onward, made)
            if branches[-1].has_guard:
                branches.append(following)
            states[connector] = ChoiceState(choice=tuple(branches))
            states.update(made)
            following = Transition(target=connector)
        return following

    @staticmethod
    def _default(rule: Rule, by_default: str, following: Transition, last: Transition) -> list[Transition]:
        """Return the transition to the next insertion if the rule continues so by default; else an empty list."""
        if rule.then != by_default:
            return []
        if rule.do.passed:  # only the transition into the step passes arguments
            return [last.model_copy(update={"passed": {**last.passed, **rule.do.passed}})]
        return [following]

    def _onward(self, rule: Rule, number: int, name: str, state: Step, default: Onward) -> list[Transition]:
        onward = default(rule) or self._responses.onward(rule, number, name, state)
        if any(way.target is None for way in onward):
            raise SchemaError(
                f"a rule cannot '{rule.then}' at state '{name}', which stays where it is then",
                place=self._plot.place(("rules", number, "do")),
            )
        return onward


def _passing(way: Transition, target: str, kept: Mapping[str, Term]) -> dict[str, object]:
    """Return the new fields of a transition to another target; it assigns its passed arguments to variables."""
    if not kept:
        return {"target": target}
    own = (Assign(assign=way.assign),) if way.assign else ()
    do = (*way.do, *own, Assign(assign=dict(kept)))
    return {"target": target, "passed": {}, "assign": {}, "do": do}


def _in_order(result: States, states: Mapping[str, AnyState]) -> States:
    """Return `result` in another order: the states in `states` first, then the added states."""
    return {**{name: result[name] for name in states}, **result}
