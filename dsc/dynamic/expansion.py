"""Rules and handlers become ordinary states and transitions (S1.4, S1.14), visible in every drawing.

For each submachine or dynamic state and each outcome that its own `on` does not settle, the rules of its plot
follow in order. A rule that uses a recovery plot adds a state for it. How often a rule has answered for a
state is counted in a variable of the plot, so that it is part of the machine's state like everything else.
In a generated plot, what no rule takes leads to `replan`, and what leads to a state leaves the plot. Failures of skills
inside are answered like outcomes.
"""

from __future__ import annotations

from collections.abc import Mapping

from dsc.dynamic.added import Added
from dsc.dynamic.detours import Detours
from dsc.dynamic.handlers import with_handlers
from dsc.dynamic.leading import answered, led_away
from dsc.dynamic.outcomes import Plots, answerable
from dsc.dynamic.responses import Responses, States, reason_of
from dsc.dynamic.steps import Step, about_step, answers_in_plans, concerns
from dsc.events import NO_CANDIDATE
from dsc.model.plot import ActionPlot, Scope, initial_of
from dsc.model.rules import REPLAN
from dsc.model.states import AnyState, CompositeState, DynamicState, OrthogonalState, SubmachineState


def expand(plot: ActionPlot, plots: Plots) -> ActionPlot:
    """The plot with its rules and handlers turned into states and transitions.

    Raises:
        UnknownNameError: a rule or state names a plot that is not there.
        SchemaError: a rule cannot be carried out at a state.
    """
    if not plot.rules and not plot.handlers and not plot.generated:
        return plot
    expansion = _Expansion(plot, plots)
    added = expansion.added
    expanded = plot.model_copy(update={**expansion.scope(plot), "rules": (), "handlers": ()})
    if plot.handlers:
        expanded = with_handlers(expanded, plot, plots, added, expansion.detours.entrances)
    return expanded.model_copy(update={"variables": {**plot.variables, **added.variables}})


class _Expansion:
    def __init__(self, plot: ActionPlot, plots: Plots) -> None:
        self._plot, self._plots = plot, plots
        self.added = Added(plot)
        self._responses = Responses(plot, plots, self.added)
        self._in_plans = [rule for rule in plot.rules if rule.leads_away and answers_in_plans(rule, plots)]
        self._given_up: dict[str, str] = {}  # by what states say so inside, and why
        self.detours = Detours(plot, plots, self.added, self._responses)

    def scope(self, scope: Scope) -> dict[str, object]:
        """What changes in a scope: its states, and the one to begin with if there is something before that."""
        states = self.detours.through(self._states(scope.states), scope.states)
        entrance = self.detours.entrances.get(initial_of(scope))
        return {"states": states} if entrance is None else {"states": states, "initial": entrance}

    def _states(self, states: Mapping[str, AnyState]) -> States:
        """The states of one scope, each followed by the recoveries its rules need."""
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
        """A state that contains others."""
        before, self._given_up = self._given_up, {}
        if isinstance(state, CompositeState):
            inside = self.scope(state)
        else:
            inside = {"regions": {key: one.model_copy(update=self.scope(one)) for key, one in state.regions.items()}}
        on = answered(state.on, self._given_up)
        self._given_up = {**before, **self._given_up}
        return state.model_copy(update={**inside, "on": on})

    def _with_rules(self, name: str, state: Step, beside: Mapping[str, AnyState]) -> States:
        on = dict(state.on)
        recoveries: States = {}
        for event in answerable(state, self._plots):
            own = list(on.get(event, ()))
            if own and own[-1].guard is None:
                continue
            for number, rule in enumerate(self._plot.rules):
                if rule.on == event and concerns(rule, name, state, self._plots):
                    about = about_step(rule, state, self._plot)
                    onward = self._responses.onward(about, number, name, state)
                    own += self._responses.carried_out(about, f"{name}_{event}_{number}", onward, recoveries)
            if self._plot.generated:
                reason = "no candidate fits" if event == NO_CANDIDATE else reason_of(event)
                own.append(self._responses.ending(name, REPLAN, reason))
            if own:
                on[event] = tuple(own)
        if isinstance(state, DynamicState) and state.goal is not None:
            on = dict(led_away(name, state, on, beside, self._in_plans, self.added, self._given_up))
        return {name: state.model_copy(update={"on": on}), **recoveries}
