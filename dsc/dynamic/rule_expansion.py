"""Expansion of rules and handlers into ordinary states and transitions, which every drawing shows (S1.4, S1.14)."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, MutableMapping, Sequence
from functools import partial

from dsc.dynamic.event_handlers import with_handlers
from dsc.dynamic.fresh_names import FreshNames
from dsc.dynamic.insertions import Insertions
from dsc.dynamic.responses import Responses, States, because, reason_of
from dsc.dynamic.steps import Plots, Step, about_step, answerable, answers_in_plans, concerns
from dsc.events import DONE, GAVE_UP, NO_CANDIDATE, PROGRAMMING_ERROR
from dsc.model.actions import Assign, Emit
from dsc.model.plot import ActionPlot, Scope, initial_of
from dsc.model.rules import REPLAN, Rule
from dsc.model.states import AnyState, CompositeState, DynamicState, OrthogonalState, SubmachineState
from dsc.model.transitions import Transition
from knowledge_base.language.syntax.expression import Arithmetic, Comparison, Constant, Variable


def expand(plot: ActionPlot, plots: Plots) -> ActionPlot:
    """Return the plot with states and transitions instead of its rules and handlers.

    Raises:
        UnknownNameError: a rule or state refers to a missing plot.
        SchemaError: a rule cannot be applied to a state.
    """
    if not plot.rules and not plot.handlers and not plot.generated:
        return plot
    expansion = _Expansion(plot, plots)
    added = expansion.added
    expanded = plot.model_copy(update={**expansion.scope(plot), "rules": (), "handlers": ()})
    if plot.handlers:
        expanded = with_handlers(expanded, plot, added, expansion.detours.entrances)
    return expanded.model_copy(update={"variables": {**plot.variables, **added.variables}}).with_words(added.words)


class _Expansion:
    def __init__(self, plot: ActionPlot, plots: Plots) -> None:
        self._plot, self._plots = plot, plots
        self.added = FreshNames(plot)
        self._responses = Responses(plot, plots, self.added)
        answering = [rule for rule in plot.rules if answers_in_plans(rule, plots)]
        self._in_plans = [one for rule in answering for one in rule.continuations if one.leads_away]
        self._abandoned: dict[str, str] = {}  # reasons, by the event with which an inner state reports `gave_up`
        self.detours = Insertions(plot, plots, self.added, self._responses)

    def scope(self, scope: Scope) -> dict[str, object]:
        """Return the changed fields of a scope: `states`, and `initial` if an insertion precedes the initial state."""
        states = self.detours.through(self._states(scope.states), scope.states)
        entrance = self.detours.entrances.get(initial_of(scope))
        return {"states": states} if entrance is None else {"states": states, "initial": entrance}

    def _states(self, states: Mapping[str, AnyState]) -> States:
        """Return the states of one scope; the recovery states of its rules follow each step."""
        result: States = {}
        for name, state in states.items():
            if isinstance(state, CompositeState | OrthogonalState):
                result[name] = self._around(state)
            elif isinstance(state, SubmachineState | DynamicState):
                result.update(self._with_rules(name, state, states))
            else:
                result[name] = state
        return result

    def _around(self, state: CompositeState | OrthogonalState) -> AnyState:
        """Return a composite or orthogonal state with its inner scopes expanded."""
        before, self._abandoned = self._abandoned, {}
        if isinstance(state, CompositeState):
            inside = self.scope(state)
        else:
            inside = {"regions": {key: one.model_copy(update=self.scope(one)) for key, one in state.regions.items()}}
        on = answered(state.on, self._abandoned)
        self._abandoned = {**before, **self._abandoned}
        return state.model_copy(update={**inside, "on": on})

    def _with_rules(self, name: str, state: Step, beside: Mapping[str, AnyState]) -> States:
        on = dict(state.on)
        recoveries: States = {}
        for event in answerable(state, self._plots):
            own = list(on.get(event, ()))
            if own and not own[-1].has_guard:
                continue
            for number, rule in enumerate(self._plot.rules):
                if rule.on == event and concerns(rule, name, state, self._plots):
                    about = about_step(rule, state, self._plot)
                    onward = partial(self._responses.onward, number=number, name=name, state=state)
                    own += self._responses.execute(about, name, f"{name}_{event}_{number}", onward, recoveries)
            if self._plot.generated and event != PROGRAMMING_ERROR:
                reason = NO_CANDIDATE_FITS if event == NO_CANDIDATE else reason_of(event)
                own.append(self._responses.ending(name, REPLAN, reason))
            if own:
                on[event] = tuple(own)
        if isinstance(state, DynamicState) and state.goal is not None:
            on = dict(led_away(name, state, on, beside, self._in_plans, self.added, self._abandoned))
        return {name: state.model_copy(update={"on": on}), **recoveries}


NO_CANDIDATE_FITS = "no candidate fits"
"""The reason of a plan's step whose candidates all have false conditions."""
Ways = Mapping[str, tuple[Transition, ...]]
"""Transitions by event, tried in order."""


def led_away(
    name: str,
    state: DynamicState,
    on: Ways,
    beside: Container[str],
    rules: Iterable[Rule],
    added: FreshNames,
    abandoned: MutableMapping[str, str],
) -> Ways:
    """Return the transitions of a state with a goal, including the transitions of rules that leave its plans.

    Args:
        name: name of the state.
        state: the state, whose budget bounds the number of plans.
        on: transitions of the state without these rules.
        beside: names of the states in the state's scope.
        rules: rules that may respond to steps of plans.
        added: generator of names for added elements.
        abandoned: mapping to which the events are added that report `gave_up` of the state, with reasons; `answered`
            reads this mapping.
    """
    leading = {rule.outcome: rule for rule in rules if rule.leads_away and rule.then in beside}
    if not leading:
        return on
    counter = added.variable(f"left_{name}", f"times that rules have left {name}", "number", 0)
    ways = {**on, DONE: tuple(_resetting(way, counter) for way in on.get(DONE, ()))}
    own = on.get(GAVE_UP, ())
    for event, rule in leading.items():
        most = state.budget.replans
        reason = f"the budget of {most} new plans is used up: rules have led to '{rule.then}' once more"
        ways[event] = (_way(rule, counter, most), *(because(reason, way) for way in own))
        if not _settles(own):
            report = added.event(f"{GAVE_UP}_{name}_{rule.then}", f"{GAVE_UP} of {name}")
            abandoned[report] = reason
            ways[event] += (Transition(do=(Emit(emit=report),)),)
    return ways


def answered(on: Ways, abandoned: MutableMapping[str, str]) -> Ways:
    """Return the transitions of a state, including those on the reports of `gave_up` from inner states.

    Remove from `abandoned` each report that these transitions always handle.
    """
    own = on.get(GAVE_UP, ())
    if not (own and abandoned):
        return on
    ways = {**on, **{report: tuple(because(reason, way) for way in own) for report, reason in abandoned.items()}}
    if _settles(own):
        abandoned.clear()
    return ways


def _settles(ways: Sequence[Transition]) -> bool:
    return bool(ways) and not ways[-1].has_guard


def _way(rule: Rule, counter: str, most: int) -> Transition:
    left = Variable(counter)
    return Transition(
        target=rule.then,
        guard=Comparison("<=", left, Constant(most)),
        do=(Assign(assign={counter: Arithmetic("+", (left, Constant(1)))}),),
        passed={name: Variable(f"event.{name}") for name in rule.do.passed},
    )


def _resetting(way: Transition, counter: str) -> Transition:
    return way.model_copy(update={"do": (Assign(assign={counter: Constant(0)}), *way.do)})
