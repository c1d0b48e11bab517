"""Contingency rules become ordinary states and transitions (S1.4), visible in every drawing.

For each submachine or dynamic state and each outcome that its own `on` does not settle, the rules of its plot
follow in order. A rule that uses a recovery plot adds a state for it. How often a rule has answered for a
state is counted in a variable of the plot, so that it is part of the machine's state like everything else.
In a generated plot, what no rule takes leads to `replan`. Failures of skills inside are answered like outcomes.
"""

from __future__ import annotations

import itertools
from collections import ChainMap
from collections.abc import Container, Mapping
from dataclasses import dataclass, field

from dsc.dynamic.outcomes import Plots, answerable
from dsc.events import DONE, FAILURES, GAVE_UP, NO_CANDIDATE
from dsc.model.actions import Assign, Emit, Internal, Tell
from dsc.model.plot import ActionPlot, Rule, Variable
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    OrthogonalState,
    State,
    SubmachineState,
)
from dsc.model.transitions import Transition
from knowledge_base.errors import SchemaError
from knowledge_base.language import expression as lang
from knowledge_base.language.effect import substitute_effect

DEFAULT_RETRIES = 3
"""Bound on `retry` and `replan` responses that name none, so that no rule can go on for ever."""

REPLAN = "replan"
"""Outcome of a generated plot that sends it back to planning; `gave_up` ends the attempt.

Wherever a step stands, there is a final state beside it that emits each of the two.
"""


def expand_rules(plot: ActionPlot, plots: Plots) -> ActionPlot:
    """The plot with its rules turned into states and transitions.

    Raises:
        UnknownNameError: a rule or state names a plot that is not there.
    """
    if not plot.rules and not plot.generated:
        return plot
    expansion = _Expansion(plot, plots)
    states = expansion.scope(plot.states)
    variables = {**plot.variables, **expansion.counters}
    return plot.model_copy(update={"states": states, "variables": variables, "rules": ()})


@dataclass(slots=True)
class _Expansion:
    plot: ActionPlot
    plots: Plots
    counters: dict[str, Variable] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    beside: dict[str, Mapping[str, AnyState]] = field(default_factory=dict)
    endings: dict[tuple[str, str], Transition] = field(default_factory=dict)
    ends: dict[tuple[int, str], str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.names = {name for name, _, _ in self.plot.walk()}
        self.beside = {name: scope.states for scope in self.plot.scopes() for name in scope.states}

    def scope(self, states: Mapping[str, AnyState]) -> dict[str, AnyState]:
        """The states of one scope, each followed by the recoveries its rules need."""
        result: dict[str, AnyState] = {}
        for name, state in states.items():
            if isinstance(state, CompositeState):
                result[name] = state.model_copy(update={"states": self.scope(state.states)})
            elif isinstance(state, OrthogonalState):
                regions = {
                    key: region.model_copy(update={"states": self.scope(region.states)})
                    for key, region in state.regions.items()
                }
                result[name] = state.model_copy(update={"regions": regions})
            elif isinstance(state, SubmachineState | DynamicState):
                result.update(self._with_rules(name, state))
            else:
                result[name] = state
        return result

    def _with_rules(self, name: str, state: SubmachineState | DynamicState) -> dict[str, AnyState]:
        on = dict(state.on)
        recoveries: dict[str, AnyState] = {}
        for event in answerable(state, self.plots):
            own = list(on.get(event, ()))
            if own and own[-1].guard is None:
                continue
            for number, rule in enumerate(self.plot.rules):
                if rule.on == event and (not rule.of or name in rule.of):
                    own += self._answer(rule, f"{name}_{event}_{number}", name, state, recoveries)
            if self.plot.generated:
                own.append(self._ending(name, REPLAN, "no candidate fits" if event == NO_CANDIDATE else _reason(event)))
            if own:
                on[event] = tuple(own)
        return {name: state.model_copy(update={"on": on}), **recoveries}

    def _ending(self, name: str, outcome: str, reason: str) -> Transition:
        """To the final state beside a step that ends the generated plot with the outcome."""
        end = self._end(self.beside[name], outcome)
        if (end, reason) not in self.endings:  # the same for many steps
            self.endings[end, reason] = Transition.model_validate({"to": end, "assign": {"reason": reason}})
        return self.endings[end, reason]

    def _end(self, scope: Mapping[str, AnyState], outcome: str) -> str:
        """The final state of a scope that emits the outcome; looked for once."""
        if (id(scope), outcome) not in self.ends:
            found = (each for each, one in scope.items() if isinstance(one, FinalState) and one.emit == outcome)
            self.ends[id(scope), outcome] = next(found, outcome)
        return self.ends[id(scope), outcome]

    def _answer(
        self, rule: Rule, key: str, name: str, state: State, recoveries: dict[str, AnyState]
    ) -> list[Transition]:
        """The transitions that carry out one rule; a recovery state is added where it needs one."""
        response = rule.do
        onward = self._onward(rule, name, state)
        guard, counting = self._limit(rule, key)
        if response.use is None:
            return [_joined(rule, guard, counting, after) for after in onward]
        recovery = _unused(f"{key}_{response.use}", self.names)
        self.names.add(recovery)
        ends = (DONE, *self.plots.plot(response.use).emits)
        recoveries[recovery] = SubmachineState(
            use=response.use,
            arguments=response.arguments,
            on={end: tuple(onward) for end in ends},
            about=f"rule: on {rule.on} {response.use}, then {response.then}",
        )
        return [_joined(rule, guard, counting, Transition(target=recovery))]

    def _limit(self, rule: Rule, key: str) -> tuple[lang.Expression | None, dict[str, lang.Term]]:
        bounded = rule.do.then == "retry" or (rule.do.then == "replan" and not self.plot.generated)
        limit = rule.do.limit or (DEFAULT_RETRIES if bounded else None)
        if limit is None:
            return rule.when, {}
        declared = self.plot.parameters, self.plot.variables, self.plot.outputs
        taken = ChainMap[str, object](self.counters, *declared)  # type: ignore[arg-type]
        counter = _unused(f"tries_{key}".lower().replace("-", "_"), taken)
        self.counters[counter] = Variable.model_validate({"type": "number", "initial": 0})
        tries = lang.Variable(counter)
        below = lang.Comparison("<", tries, lang.Constant(limit))
        guard = below if rule.when is None else lang.And((below, rule.when))
        return guard, {counter: lang.Arithmetic("+", (tries, lang.Constant(1)))}

    def _onward(self, rule: Rule, name: str, state: State) -> list[Transition]:
        then = rule.do.then
        reason = rule.on if rule.do.use else _reason(rule.on)  # after a recovery, the event is another one
        if then == "continue":
            return self._wired(rule, name, state, DONE)
        if then == "replan" and self.plot.generated:
            return [self._ending(name, REPLAN, reason)]
        if then == "give_up":
            if self.plot.generated:
                return [self._ending(name, GAVE_UP, reason)]
            return [_because(rule.on, one) for one in self._wired(rule, name, state, GAVE_UP)]
        return [Transition(target=name if then in {"retry", "replan"} else then)]

    def _wired(self, rule: Rule, name: str, state: State, event: str) -> list[Transition]:
        if event not in state.on:
            raise SchemaError(
                f"a rule cannot '{rule.do.then}' at state '{name}', which does not wire '{event}'",
                place=self.plot.place(("rules", self.plot.rules.index(rule), "do", "then")),
            )
        return list(state.on[event])


def _reason(event: str) -> str:
    """Why a step did not go on: a failure says so itself."""
    return "?event.reason" if event in FAILURES else event


def _because(outcome: str, giving_up: Transition) -> Transition:
    """A state's way out on `gave_up`, taken on another outcome: that outcome is the reason."""
    reason = {"event.reason": outcome}
    return giving_up.model_copy(update={
        "guard": None if giving_up.guard is None else lang.substitute(giving_up.guard, reason),
        "assign": _filled(giving_up.assign, reason),
        "arguments": _filled(giving_up.arguments, reason),
        "passed": _filled(giving_up.passed, reason),
        "tell": None if giving_up.tell is None else substitute_effect(giving_up.tell, reason),
        "do": tuple(_action_because(action, reason) for action in giving_up.do),
    })


def _action_because(action: Internal, reason: Mapping[str, str]) -> Internal:
    match action:
        case Tell():
            return Tell(tell=substitute_effect(action.tell, reason))
        case Assign():
            return Assign(assign=_filled(action.assign, reason))
        case Emit():
            return action.model_copy(update={"arguments": _filled(action.arguments, reason)})
        case _:  # a log or a branch of profile scxml stays as it is
            return action


def _filled(terms: Mapping[str, lang.Term], reason: Mapping[str, str]) -> dict[str, lang.Term]:
    return {name: lang.substitute_term(term, reason) for name, term in terms.items()}


def _unused(name: str, taken: Container[str]) -> str:
    """The name, with a number behind it if it is taken."""
    numbered = (f"{name}_{number}" for number in itertools.count(2))
    return name if name not in taken else next(other for other in numbered if other not in taken)


def _joined(
    rule: Rule, guard: lang.Expression | None, counting: Mapping[str, lang.Term], after: Transition
) -> Transition:
    """One transition that does what the rule says and then what comes after it."""
    both = [part for part in (guard, after.guard) if part is not None]
    actions: list[Internal] = []
    if rule.do.tell is not None:
        actions.append(Tell(tell=rule.do.tell))
    if counting:
        actions.append(Assign(assign=dict(counting)))
    return after.model_copy(update={
        "guard": None if not both else both[0] if len(both) == 1 else lang.And(tuple(both)),
        "do": (*actions, *after.do),
        "rule": rule.label,
    })
