"""Responses of rules, expanded into transitions, recovery states and variables for counters and stored values."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from dsc.dynamic.fresh_names import FreshNames
from dsc.dynamic.steps import Plots, filled
from dsc.events import DONE, FAILURES, GAVE_UP, SKILL_FAILURES
from dsc.model.actions import (
    Assign,
    Block,
    Choose,
    Emit,
    Log,
    Perform,
    StartActivity,
    StopActivity,
    Tell,
    Withdraw,
    WrittenAction,
)
from dsc.model.plot import ActionPlot
from dsc.model.rules import CONTINUE, ENTER, GIVE_UP, REPLAN, RETRY, Rule
from dsc.model.states import AnyState, FinalState, State, SubmachineState
from dsc.model.transitions import Transition
from knowledge_base.errors import SchemaError
from knowledge_base.language.syntax import expression as lang
from knowledge_base.language.syntax.effect import substitute_effect

DEFAULT_RETRIES = 3
"""Upper bound of `retry` and `replan` responses without a written `limit`, so that no rule repeats without end."""

States = dict[str, AnyState]
Terms = Mapping[str, lang.Term]
Onward = Callable[[Rule], list[Transition]]


class Responses:
    """Expansion of the responses of one plot's rules.

    Args:
        plot: the plot with the rules.
        plots: provider of the plots that rules use.
        added: generator of names for added elements.
    """

    def __init__(self, plot: ActionPlot, plots: Plots, added: FreshNames) -> None:
        self._plot = plot
        self._plots = plots
        self._added = added
        self._interrupted = any(handler.interrupt for handler in plot.handlers)
        self._sidecar = {name: scope.states for scope in plot.scopes() for name in scope.states}
        self._states = {name: state for name, state, _ in plot.walk()}
        self._ends: dict[tuple[int, str], str] = {}
        self._endings: dict[tuple[str, str], Transition] = {}

    def execute(self, rule: Rule, step: str, key: str, onward: Onward, states: States) -> list[Transition]:
        """Return transitions that execute a rule's response and then continue.

        A response with commands or a plot needs a recovery state, which is added to `states`.

        Args:
            rule: the rule, with the step's arguments already substituted.
            step: name of the step.
            key: common part of the names of added elements.
            onward: function that returns the transitions for the continuation of a rule.
            states: mapping to which the recovery state is added.
        """
        guard, counting = self._limit(rule, key)
        if not rule.do.acts:
            return [_join(rule, guard, counting, self._handed_out(after)) for after in onward(rule)]
        name = self._added.state(f"{key}_{rule.do.use or 'command'}", rule.label)
        kept: dict[str, lang.Term] = {}
        ways = {DONE: onward(rule), **{outcome: onward(rule.after_outcome(outcome)) for outcome in rule.do.on}}
        on = {event: tuple(self._afterwards(way, key, kept) for way in found) for event, found in ways.items()}
        states[name] = self._acting(rule, key, {**self._replanning(rule, step), **on}, kept)
        return [_join(rule, guard, {**counting, **kept}, Transition(target=name))]

    def _afterwards(self, way: Transition, key: str, kept: dict[str, lang.Term]) -> Transition:
        """Return a transition out of a recovery state; `kept` receives the values that it can no longer read."""
        return self._handed_out(way.model_copy(update={"passed": self._keep(way.passed, key, kept)}))

    def _replanning(self, rule: Rule, step: str) -> dict[str, tuple[Transition, ...]]:
        """Return transitions for all outcomes and failures of a rule's plot inside a plan, which need a new plan."""
        if rule.do.use is None:
            return {}
        events = (*self._plots.plot(rule.do.use).emits, *sorted(FAILURES))
        if not self._plot.generated:
            return {}
        return {event: (self.ending(step, REPLAN, reason_of(event)),) for event in events}

    def onward(self, rule: Rule, number: int, name: str, state: State) -> list[Transition]:
        """Return the transitions for the continuation of a rule at a step.

        Args:
            rule: the rule, with the step's arguments already substituted.
            number: position of the rule in the plot.
            name: name of the step.
            state: the step.

        Raises:
            SchemaError: the step has no transition for the continuation.
        """
        then, about = rule.then, rule.label if rule.on is None else rule.on
        if self._plot.generated and (then in {REPLAN, GIVE_UP} or rule.leads_away):
            return [self._leaving(rule, name, about)]
        if then == CONTINUE and rule.before and skipped(name) in self._sidecar[name]:
            return [Transition(target=skipped(name))]
        if then == CONTINUE:
            return self._require_transitions(rule, number, name, state, DONE)
        if then == GIVE_UP:
            return [because(about, one) for one in self._require_transitions(rule, number, name, state, GAVE_UP)]
        if then in {RETRY, REPLAN, ENTER}:
            tested = again(name) in self._sidecar[name] and not rule.do.passed
            return [Transition(target=again(name) if tested else name, passed=rule.do.passed)]
        return [Transition(target=then, passed=rule.do.passed)]

    def _leaving(self, rule: Rule, name: str, about: str) -> Transition:
        """Return a transition from a step to the final state with which a rule ends the generated plot."""
        if rule.leads_away:
            return Transition(target=self._end(self._sidecar[name], rule.outcome), passed=rule.do.passed)
        reason = about if rule.do.acts or rule.on is None else reason_of(rule.on)  # `about` if the event is `done`
        return self.ending(name, REPLAN if rule.then == REPLAN else GAVE_UP, reason)

    def ending(self, name: str, outcome: str, reason: str) -> Transition:
        """Return a transition from the step `name` to the final state that ends the generated plot with an outcome."""
        end = self._end(self._sidecar[name], outcome)
        if (end, reason) not in self._endings:  # many steps share the transition
            self._endings[end, reason] = Transition.model_validate({"to": end, "assign": {"reason": reason}})
        return self._endings[end, reason]

    def _handed_out(self, way: Transition) -> Transition:
        """Return a transition to a final state, with its arguments assigned to the variables of the outcome."""
        end = self._states.get(way.target or "")
        if not way.passed or not isinstance(end, FinalState):
            return way
        handed = {term.name: way.passed[key] for key, term in end.arguments.items() if isinstance(term, lang.Variable)}
        return way.model_copy(update={"passed": {}, "do": (*way.do, Assign(assign=handed))})

    def _end(self, scope: Mapping[str, AnyState], outcome: str) -> str:
        """Return the name of the scope's final state that emits the outcome; the outcome itself if none emits it."""
        if (id(scope), outcome) not in self._ends:
            found = (each for each, one in scope.items() if isinstance(one, FinalState) and one.emit == outcome)
            self._ends[id(scope), outcome] = next(found, outcome)
        return self._ends[id(scope), outcome]

    def remembered(self, terms: Terms, key: str, kept: dict[str, lang.Term]) -> dict[str, lang.Term]:
        """Return a new variable for each term; add the assignments of the terms to these variables to `kept`."""
        found: dict[str, lang.Term] = {}
        for name, term in terms.items():
            variable = self._added.variable(f"kept_{key}_{name}", f"{name}, kept", "symbol")
            kept[variable] = term
            found[name] = lang.Variable(variable)
        return found

    def _keep(self, terms: Terms, key: str, kept: dict[str, lang.Term]) -> dict[str, lang.Term]:
        """Return the terms; a new variable replaces each term that reads the event, and `kept` receives its assignment.

        The variables are necessary because a later state can no longer read the event's attributes.
        """
        lost = {name: term for name, term in terms.items() if reads_event(term)}
        return {**terms, **self.remembered(lost, key, kept)}

    def _acting(
        self, rule: Rule, key: str, on: Mapping[str, tuple[Transition, ...]], kept: dict[str, lang.Term]
    ) -> AnyState:
        do, about = rule.do, f"rule: {_spoken(rule)} {rule.do.use or 'command'}, then {rule.then}"
        if do.use is None:
            return State(entry=do.command, on=on, about=about)
        arguments = self._keep(do.arguments, key, kept) if self._interrupted else do.arguments
        return SubmachineState(
            use=do.use, arguments=arguments, entry=do.command, on=on, about=about,
            priority=rule.priority, preempt=rule.preempt,
        )  # fmt: skip

    def _limit(self, rule: Rule, key: str) -> tuple[lang.Expression | None, dict[str, lang.Term]]:
        limit = limit_of(rule, generated=self._plot.generated)
        if limit is None:
            return rule.when, {}
        counter = self._added.variable(f"tries_{key}", f"tries of {rule.label}", "number", 0)
        tries = lang.Variable(counter)
        below = lang.Comparison("<", tries, lang.Constant(limit))
        guard = below if rule.when is None else lang.And((below, rule.when))
        return guard, {counter: lang.Arithmetic("+", (tries, lang.Constant(1)))}

    def _require_transitions(self, rule: Rule, number: int, name: str, state: State, event: str) -> list[Transition]:
        if event not in state.on:
            raise SchemaError(
                f"a rule cannot '{rule.then}' at state '{name}', which does not wire '{event}'",
                place=self._plot.place(("rules", number, "do", "then")),
            )
        return list(state.on[event])


def limit_of(rule: Rule, *, generated: bool = False) -> int | None:
    """Return the upper bound of a rule's responses for one state; `None` means no bound."""
    repeating = {RETRY} if generated else {RETRY, REPLAN}
    bounded = any(one.then in repeating for one in rule.continuations)
    return rule.do.limit or (DEFAULT_RETRIES if bounded else None)


def skipped(step: str) -> str:
    """Return the name of the state that continues a generated plot after a step without waiting for its effects."""
    return f"{step}_skipped"


def again(step: str) -> str:
    """Return the name of the state of a generated plot that tests the conditions of a step before its next entry."""
    return f"{step}_again"


def reason_of(event: str) -> str:
    """Return the reason of a step's failure: the attribute `reason` of a failure event, else the event's name."""
    return "?event.reason" if event in SKILL_FAILURES else event


def reads_event(term: lang.Term) -> bool:
    """Return whether a term reads an attribute of the current event."""
    return any(name.startswith("event.") for name in lang.free_variables(term))


def _spoken(rule: Rule) -> str:
    return f"on {rule.on}" if rule.on is not None else f"{rule.place} {', '.join(rule.steps)}"


def because(outcome: str, abandoning: Transition) -> Transition:
    """Return a transition on `gave_up` for another outcome; this outcome replaces `event.reason`."""
    reason = {"event.reason": lang.Constant(outcome)}
    return abandoning.model_copy(
        update={
            "guard": None if abandoning.guard is None else lang.substitute(abandoning.guard, reason),
            "bind": {name: lang.substitute(one, reason) for name, one in abandoning.bind.items()},
            "bind_all": {name: lang.substitute(one, reason) for name, one in abandoning.bind_all.items()},
            "order_by": tuple(lang.substitute(one, reason) for one in abandoning.order_by),
            "assign": filled(abandoning.assign, reason),
            "arguments": filled(abandoning.arguments, reason),
            "passed": filled(abandoning.passed, reason),
            "tell": None if abandoning.tell is None else substitute_effect(abandoning.tell, reason),
            "do": tuple(_action_because(action, reason) for action in abandoning.do),
        }
    )


def _action_because(action: WrittenAction, reason: Terms) -> WrittenAction:
    match action:
        case Tell():
            return Tell(tell=substitute_effect(action.tell, reason))
        case Assign():
            return Assign(assign=filled(action.assign, reason))
        case Emit():
            return action.model_copy(update={"arguments": filled(action.arguments, reason)})
        case Perform() | StartActivity() | StopActivity() | Withdraw() | Log() | Choose() | Block():
            return action  # without a reason, or of dialect scxml


def _join(rule: Rule, guard: lang.Expression | None, counting: Terms, after: Transition) -> Transition:
    """Return the transition `after` with the rule's guard, and with the rule's actions before its actions."""
    both = [part for part in (guard, after.guard) if part is not None]
    actions: list[WrittenAction] = []
    if rule.do.tell is not None:
        actions.append(Tell(tell=rule.do.tell))
    if counting:
        actions.append(Assign(assign=dict(counting)))
    return after.model_copy(
        update={
            "guard": None if not both else both[0] if len(both) == 1 else lang.And(tuple(both)),
            "do": (*actions, *after.do),
            "rule": rule.label,
        }
    )
