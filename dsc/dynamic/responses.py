"""What a rule's response becomes: transitions, a state that runs its recovery, variables that count and remember."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from dsc.dynamic.fresh_names import FreshNames
from dsc.dynamic.plot_outcomes import Plots
from dsc.dynamic.step_references import filled
from dsc.events import DONE, FAILURES, GAVE_UP
from dsc.model.actions import Assign, Emit, Internal, Tell
from dsc.model.plot import ActionPlot
from dsc.model.rules import CONTINUE, ENTER, GIVE_UP, REPLAN, RETRY, Rule
from dsc.model.states import AnyState, FinalState, State, SubmachineState
from dsc.model.transitions import Transition
from knowledge_base.errors import SchemaError
from knowledge_base.language import expression as lang
from knowledge_base.language.effect import substitute_effect

DEFAULT_RETRIES = 3
"""Bound on `retry` and `replan` responses that name none, so that no rule can go on for ever."""

States = dict[str, AnyState]
Terms = Mapping[str, lang.Term]


class Responses:
    """Carries out the responses of one plot's rules.

    Args:
        plot: the plot.
        plots: where the plots are found that rules use.
        added: gives names to what is added.
    """

    def __init__(self, plot: ActionPlot, plots: Plots, added: FreshNames) -> None:
        self._plot = plot
        self._plots = plots
        self._added = added
        self._interrupted = any(handler.interrupt for handler in plot.handlers)
        self._beside = {name: scope.states for scope in plot.scopes() for name in scope.states}
        self._states = {name: state for name, state, _ in plot.walk()}
        self._ends: dict[tuple[int, str], str] = {}
        self._endings: dict[tuple[str, str], Transition] = {}

    def carried_out(self, rule: Rule, key: str, onward: Iterable[Transition], states: States) -> list[Transition]:
        """The transitions that do what a rule says and then go `onward`; `states` gets the state that this takes.

        Args:
            rule: speaks of the step's arguments no more.
            key: names what is added for it.
            onward: what follows the response.
            states: is added to.
        """
        guard, counting = self._limit(rule, key)
        onward = list(onward)
        if not rule.do.acts:
            return [_joined(rule, guard, counting, self._handed_out(after)) for after in onward]
        name = self._added.state(f"{key}_{rule.do.use or 'command'}")
        kept: dict[str, lang.Term] = {}
        kept_onward = [one.model_copy(update={"passed": self._kept(one.passed, key, kept)}) for one in onward]
        onward = list(map(self._handed_out, kept_onward))
        states[name] = self._acting(rule, key, onward, kept)
        return [_joined(rule, guard, {**counting, **kept}, Transition(target=name))]

    def onward(self, rule: Rule, number: int, name: str, state: State) -> list[Transition]:
        """What follows the response of a rule, which stands at that place in the plot, to a step."""
        then, about = rule.then, rule.label if rule.on is None else rule.on
        if self._plot.generated and (then in {REPLAN, GIVE_UP} or rule.leads_away):
            return [self._leaving(rule, name, about)]
        if then == CONTINUE and rule.before and skipped(name) in self._beside[name]:
            return [Transition(target=skipped(name))]
        if then == CONTINUE:
            return self._wired(rule, number, name, state, DONE)
        if then == GIVE_UP:
            return [because(about, one) for one in self._wired(rule, number, name, state, GAVE_UP)]
        target = name if then in {RETRY, REPLAN, ENTER} else then
        return [Transition(target=target, passed=rule.do.passed)]

    def _leaving(self, rule: Rule, name: str, about: str) -> Transition:
        """Out of the generated plot."""
        if rule.leads_away:
            return Transition(target=self._end(self._beside[name], rule.outcome), passed=rule.do.passed)
        reason = about if rule.do.acts or rule.on is None else reason_of(rule.on)  # else the event is another one
        return self.ending(name, REPLAN if rule.then == REPLAN else GAVE_UP, reason)

    def ending(self, name: str, outcome: str, reason: str) -> Transition:
        """To the final state beside a step that ends the generated plot with the outcome."""
        end = self._end(self._beside[name], outcome)
        if (end, reason) not in self._endings:  # the same for many steps
            self._endings[end, reason] = Transition.model_validate({"to": end, "assign": {"reason": reason}})
        return self._endings[end, reason]

    def _handed_out(self, way: Transition) -> Transition:
        """What is passed to an end of the plot becomes the variables that this end hands out."""
        end = self._states.get(way.target or "")
        if not way.passed or not isinstance(end, FinalState):
            return way
        handed = {term.name: way.passed[key] for key, term in end.arguments.items() if isinstance(term, lang.Variable)}
        return way.model_copy(update={"passed": {}, "do": (*way.do, Assign(assign=handed))})

    def _end(self, scope: Mapping[str, AnyState], outcome: str) -> str:
        """The final state of a scope that emits the outcome; looked for once."""
        if (id(scope), outcome) not in self._ends:
            found = (each for each, one in scope.items() if isinstance(one, FinalState) and one.emit == outcome)
            self._ends[id(scope), outcome] = next(found, outcome)
        return self._ends[id(scope), outcome]

    def remembered(self, terms: Terms, key: str, kept: dict[str, lang.Term]) -> dict[str, lang.Term]:
        """The terms as variables of the plot, which `kept` says how to assign."""
        found: dict[str, lang.Term] = {}
        for name, term in terms.items():
            variable = self._added.variable(f"kept_{key}_{name}", "symbol")
            kept[variable] = term
            found[name] = lang.Variable(variable)
        return found

    def _kept(self, terms: Terms, key: str, kept: dict[str, lang.Term]) -> dict[str, lang.Term]:
        """The terms with those remembered that read the event: it is gone when the state is left or entered anew."""
        lost = {name: term for name, term in terms.items() if reads_event(term)}
        return {**terms, **self.remembered(lost, key, kept)}

    def _acting(self, rule: Rule, key: str, onward: Iterable[Transition], kept: dict[str, lang.Term]) -> AnyState:
        do, about = rule.do, f"rule: {_spoken(rule)} {rule.do.use or 'command'}, then {rule.then}"
        if do.use is None:
            return State(entry=do.command, on={DONE: tuple(onward)}, about=about)
        arguments = self._kept(do.arguments, key, kept) if self._interrupted else do.arguments
        ends = (DONE, *self._plots.plot(do.use).emits)
        on = {end: tuple(onward) for end in ends}
        return SubmachineState(use=do.use, arguments=arguments, entry=do.command, on=on, about=about)

    def _limit(self, rule: Rule, key: str) -> tuple[lang.Expression | None, dict[str, lang.Term]]:
        limit = limit_of(rule, generated=self._plot.generated)
        if limit is None:
            return rule.when, {}
        counter = self._added.variable(f"tries_{key}", "number", 0)
        tries = lang.Variable(counter)
        below = lang.Comparison("<", tries, lang.Constant(limit))
        guard = below if rule.when is None else lang.And((below, rule.when))
        return guard, {counter: lang.Arithmetic("+", (tries, lang.Constant(1)))}

    def _wired(self, rule: Rule, number: int, name: str, state: State, event: str) -> list[Transition]:
        if event not in state.on:
            raise SchemaError(
                f"a rule cannot '{rule.then}' at state '{name}', which does not wire '{event}'",
                place=self._plot.place(("rules", number, "do", "then")),
            )
        return list(state.on[event])


def limit_of(rule: Rule, *, generated: bool = False) -> int | None:
    """How often a rule answers for one state; `None` for as often as need be."""
    bounded = rule.then == RETRY or (rule.then == REPLAN and not generated)
    return rule.do.limit or (DEFAULT_RETRIES if bounded else None)


def skipped(step: str) -> str:
    """In a generated plot, the state beside a step that goes on without waiting for the effects it would have had."""
    return f"{step}_skipped"


def reason_of(event: str) -> str:
    """Why a step did not go on: a failure says so itself."""
    return "?event.reason" if event in FAILURES else event


def reads_event(term: lang.Term) -> bool:
    """Whether a term reads an attribute of the event."""
    return any(name.startswith("event.") for name in lang.free_variables(term))


def _spoken(rule: Rule) -> str:
    return f"on {rule.on}" if rule.on is not None else f"{rule.place} {', '.join(rule.steps)}"


def because(outcome: str, giving_up: Transition) -> Transition:
    """A state's way out on `gave_up`, taken on another outcome: that outcome is the reason."""
    reason = {"event.reason": lang.Constant(outcome)}
    return giving_up.model_copy(
        update={
            "guard": None if giving_up.guard is None else lang.substitute(giving_up.guard, reason),
            "assign": filled(giving_up.assign, reason),
            "arguments": filled(giving_up.arguments, reason),
            "passed": filled(giving_up.passed, reason),
            "tell": None if giving_up.tell is None else substitute_effect(giving_up.tell, reason),
            "do": tuple(_action_because(action, reason) for action in giving_up.do),
        }
    )


def _action_because(action: Internal, reason: Terms) -> Internal:
    match action:
        case Tell():
            return Tell(tell=substitute_effect(action.tell, reason))
        case Assign():
            return Assign(assign=filled(action.assign, reason))
        case Emit():
            return action.model_copy(update={"arguments": filled(action.arguments, reason)})
        case _:  # a log or a branch of dialect scxml stays as it is
            return action


def _joined(rule: Rule, guard: lang.Expression | None, counting: Terms, after: Transition) -> Transition:
    """One transition that does what the rule says and then what comes after it."""
    both = [part for part in (guard, after.guard) if part is not None]
    actions: list[Internal] = []
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
