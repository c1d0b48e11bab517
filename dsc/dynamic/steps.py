"""Steps, states that contain another plot: their outcomes, outputs and contents, and the rules that apply to them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Protocol

from dsc.events import (
    COMPONENT_FAILED,
    COMPONENT_RECOVERED,
    GAVE_UP,
    NO_CANDIDATE,
    NO_PLAN,
    PROGRAMMING_ERROR,
    SKILL_ERROR,
    SKILL_FAILURES,
    TIMED_OUT,
)
from dsc.model.actions import Configure, Send, Switch
from dsc.model.data_forms import literal_parts
from dsc.model.plot import ActionPlot
from dsc.model.rules import STEP, Command, Handler, Response, Rule
from dsc.model.states import AnyState, DynamicState, SubmachineState
from knowledge_base.errors import SchemaError
from knowledge_base.language.syntax.effect import mentioned, quantified_in, substitute_effect
from knowledge_base.language.syntax.expression import Term, Variable, free_variables, substitute
from knowledge_base.language.syntax.text import to_text

Outcomes = Mapping[str, Mapping[str, str] | None]
"""Types of attributes by attribute name, by event name; `None` if the attributes are unknown."""

_FAILED: Outcomes = {
    SKILL_ERROR: {"skill": "text", "reason": "text"},
    PROGRAMMING_ERROR: {"skill": "text", "reason": "text"},
    TIMED_OUT: {"skill": "text", "reason": "text", "seconds": "number"},
}
COMPONENT_EVENTS: Outcomes = {
    COMPONENT_FAILED: {"component": "text", "reason": "text"},
    COMPONENT_RECOVERED: {"component": "text"},
}
"""Events about components, which all plots see."""


class Plots(Protocol):
    """Provider of plots by name."""

    def __iter__(self) -> Iterator[ActionPlot]:
        """Yield all plots."""
        ...

    def __contains__(self, name: object) -> bool:
        """Return whether there is a plot of that name."""
        ...

    def plot(self, name: str) -> ActionPlot:
        """Return the plot of that name; raise `UnknownNameError` if there is none."""
        ...


def candidates_of(state: DynamicState, plots: Plots) -> list[ActionPlot]:
    """Return the candidates of a dynamic state; a listed plot that is not installed is omitted (S0.4)."""
    if state.offer is not None:
        return [plot for plot in plots if state.offer in plot.offers]
    return [plots.plot(name) for name in state.candidates if name in plots]


def is_open(state: AnyState, plots: Plots) -> bool:
    """Return whether plots that arrive later may become the content of a state, as data or as candidates."""
    if isinstance(state, SubmachineState):
        return state.use.startswith("?")
    if not isinstance(state, DynamicState):
        return False
    return state.offer is not None or any(name not in plots for name in state.candidates)


def offers_for(plot: ActionPlot, plots: Plots) -> list[ActionPlot]:
    """Return the plots that the dynamic states of a plot find by what they offer."""
    states = [state for _, state, _ in plot.walk()]
    wanted = {state.offer for state in states if isinstance(state, DynamicState)}
    return [one for one in plots if not wanted.isdisjoint(one.offers)]


def outputs_of(state: AnyState, plots: Plots) -> Mapping[str, str] | None:
    """Return the types of a state's outputs by name (S2.1); `None` if the state's plot is the value of a variable.

    A dynamic state has the outputs that all its candidates have with equal types. A plan for a goal has no outputs.

    Raises:
        UnknownNameError: the state names a missing plot.
    """
    if isinstance(state, SubmachineState):
        return None if state.use.startswith("?") else _outputs(plots.plot(state.use))
    if not isinstance(state, DynamicState) or state.goal is not None:
        return {}
    first, *others = [set(_outputs(plot).items()) for plot in candidates_of(state, plots)] or [set()]
    return dict(sorted(first.intersection(*others)))


def _outputs(plot: ActionPlot) -> dict[str, str]:
    return {name: output.type for name, output in plot.outputs.items()}


def outcomes_of(state: AnyState, plots: Plots) -> Outcomes:
    """Return the outcome events of a submachine or dynamic state; empty for any other state.

    The result is also empty if the state's plot is the value of a variable, because its outcomes are unknown.

    Raises:
        UnknownNameError: the state names a missing plot.
    """
    if isinstance(state, SubmachineState):
        return {} if state.use.startswith("?") else plots.plot(state.use).emits
    if not isinstance(state, DynamicState):
        return {}
    found: dict[str, Mapping[str, str] | None] = {}
    for candidate in candidates_of(state, plots):
        found.update(candidate.emits)
    if state.goal is None:
        return {**found, NO_CANDIDATE: {}}
    return {**found, NO_PLAN: {"reason": "text", "kind": NO_PLAN_KINDS}, GAVE_UP: {"reason": "text"}}


NO_PLAN_KINDS = "failed | invalid | timed_out | unsolvable"
"""The type of the attribute `kind` of the outcome `no_plan`."""


def answerable(state: AnyState, plots: Plots) -> Outcomes:
    """Return the events of a state to which a rule can respond: outcomes, and failures of skills.

    Raises:
        UnknownNameError: the state names a missing plot.
    """
    outcomes = outcomes_of(state, plots)
    return {**outcomes, **_FAILED} if isinstance(state, SubmachineState | DynamicState) else outcomes


Step = SubmachineState | DynamicState
"""A state that contains another plot."""
Terms = Mapping[str, Term]


def contents_of(step: Step, plots: Plots) -> list[ActionPlot]:
    """Return the plots that may become the content of a step; a plot that is the value of a variable is omitted.

    Raises:
        UnknownNameError: the step refers to a missing plot.
    """
    if isinstance(step, DynamicState):
        return candidates_of(step, plots)
    return [] if step.use.startswith("?") else [plots.plot(step.use)]


def is_planned(state: AnyState) -> bool:
    """Return whether a planner may provide the state's content, because the state has a goal."""
    return isinstance(state, DynamicState) and state.goal is not None


def action_of(step: Step, plots: Plots) -> str | None:
    """Return the planning action that all possible plots of a step implement; `None` if they have none in common."""
    if is_planned(step):
        return None
    actions = {plot.implements for plot in contents_of(step, plots)}
    return actions.pop() if len(actions) == 1 else None


def concerns(rule: Rule, name: str, step: Step, plots: Plots) -> bool:
    """Return whether a rule applies to the step of that name; a rule without steps applies to all steps."""
    return not rule.steps or name in rule.steps or action_of(step, plots) in rule.steps


def answers_in_plans(rule: Rule, plots: Plots) -> bool:
    """Return whether a rule may respond to steps of plans: it refers to planning actions, or applies to all steps."""
    return any(True for _ in _answered_in_plans(rule, plots))


def _answered_in_plans(rule: Rule, plots: Plots) -> Iterator[ActionPlot]:
    carrying = (plot for plot in plots if plot.implements and (not rule.steps or plot.implements in rule.steps))
    return (plot for plot in carrying if rule.on is None or rule.on in SKILL_FAILURES or rule.on in plot.emits)


def entered_by(rule: Rule, plot: ActionPlot, plots: Plots) -> Iterator[ActionPlot]:
    """Yield the plots, without repetition, that may receive the arguments that a rule passes; omit unknown plots."""
    steps = {name: state for name, state, _ in plot.walk() if isinstance(state, Step)}
    if rule.leads_away:
        entered = [steps[rule.then]] if rule.then in steps else []
    else:
        entered = [state for name, state in steps.items() if concerns(rule, name, state, plots)]
    found = {used.name: used for state in entered for used in contents_of(state, plots)}
    planned = any(map(is_planned, steps.values()))
    if planned and not rule.leads_away:
        found.update({used.name: used for used in _answered_in_plans(rule, plots)})
    yield from found.values()


def mentioned_in(rule: Rule | Handler) -> frozenset[str]:
    """Return the names of variables that the condition and the response of a rule or handler read."""
    do = rule.do
    passed = do.passed.values() if isinstance(do, Response) else ()
    terms = [*do.arguments.values(), *passed, *(term for c in do.command for term in terms_of(c).values())]
    found = frozenset[str]().union(*map(free_variables, terms))
    found |= frozenset() if rule.when is None else free_variables(rule.when)
    return found if do.tell is None else found | mentioned(do.tell)


def about_step(rule: Rule, step: Step, plot: ActionPlot) -> Rule:
    """Return the rule for one step: the step's arguments replace the variables `?step.item`.

    Raises:
        SchemaError: an argument reads a variable whose name the rule uses for another value.
    """
    read = mentioned_in(rule)
    arguments = {}
    for name in read:
        given, _, part = name.removeprefix(STEP).partition(".")
        if name.startswith(STEP) and given in step.arguments:
            arguments[name] = _part_of(step.arguments[given], part)
    if not arguments:
        return rule
    _refuse_capture(rule, arguments, plot)
    do = rule.do
    return rule.model_copy(update={
        "when": None if rule.when is None else substitute(rule.when, arguments),
        "do": do.model_copy(update={
            "tell": None if do.tell is None else substitute_effect(do.tell, arguments),
            "command": tuple(_command(one, arguments) for one in do.command),
            "arguments": filled(do.arguments, arguments),
            "passed": filled(do.passed, arguments),
        }),
    })  # fmt: skip


def _part_of(term: Term, path: str) -> Term:
    """Return the term for a part of the value of a term; an empty path is the value itself."""
    if not path:
        return term
    if isinstance(term, Variable):
        return replace(term, name=f"{term.name}.{path}")
    name, _, rest = path.partition(".")
    parts = literal_parts(term) or {}
    if name not in parts:
        raise SchemaError(f"a rule reads the part '{path}' of {to_text(term)}, which has no such part", found=path)
    return _part_of(parts[name], rest)


def filled(terms: Terms, values: Mapping[str, Term]) -> dict[str, Term]:
    """Return the terms with the variables in `values` replaced by their terms."""
    return {name: substitute(term, values) for name, term in terms.items()}


def terms_of(command: Command) -> Terms:
    """Return the terms that a command passes to its component, by name."""
    match command:
        case Configure(to=value):
            return {"to": value}
        case Send(arguments=arguments):
            return arguments
        case Switch():
            return {}


def _command(command: Command, values: Mapping[str, Term]) -> Command:
    match command:
        case Configure(to=value):
            return command.model_copy(update={"to": substitute(value, values)})
        case Send(arguments=arguments):
            return command.model_copy(update={"arguments": filled(arguments, values)})
        case Switch():
            return command


def _refuse_capture(rule: Rule, arguments: Terms, plot: ActionPlot) -> None:
    own = frozenset() if rule.when is None else quantified_in(rule.when)
    own |= frozenset() if rule.do.tell is None else quantified_in(rule.do.tell)
    for name, term in arguments.items():
        for hidden in sorted(own & free_variables(term)):
            number = plot.rules.index(rule)
            raise SchemaError(
                f"'?{name}' is the plot's '?{hidden}', and the rule means another '?{hidden}' by that name",
                place=plot.place(("rules", number)), found=hidden,
            )  # fmt: skip
