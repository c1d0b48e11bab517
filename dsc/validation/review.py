"""Review of a plot: warnings about parts that are never used, and about reactions of handlers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import chain, groupby, islice

from dsc.dynamic.library import Library
from dsc.dynamic.responses import limit_of
from dsc.dynamic.steps import Step, answerable, concerns, contents_of, is_planned
from dsc.errors import Finding
from dsc.events import TIMED_OUT
from dsc.model.actions import Trigger, flat
from dsc.model.plot import ActionPlot
from dsc.model.rules import CONTINUE, ENTER, Handler, Rule
from dsc.model.states import CompositeState, State
from dsc.skills import SkillSignature
from dsc.validation.candidates import MOST, review_candidates
from dsc.validation.emissions import review_outcomes
from dsc.validation.library import MAX_FINDINGS
from dsc.validation.names import review_names
from dsc.validation.robot import review_motors
from dsc.validation.subject import Subject, by_trigger
from dsc.validation.turns import waiting_parts
from knowledge_base.language.checking.contradiction import contradictory
from knowledge_base.language.syntax.expression import (
    TRUE,
    Expression,
    Not,
)

_REMEDY = "remove it, or change its condition"
_ONWARD = {"before": frozenset({ENTER}), "after": frozenset({CONTINUE})}
"""Continuations that lead to the next rule of the step, by the place of the rule."""


def review_plot(
    plot: ActionPlot,
    library: Library,
    skills: Iterable[SkillSignature] | None = None,
    exclusive: Collection[str] = (),
) -> list[Finding]:
    """Return at most `MAX_FINDINGS` warnings about a plot for which `validate_plot` returns no finding.

    Args:
        plot: the plot.
        library: the plots that it may use.
        skills: the deployed skills; with `None`, outcomes of plots that trigger skills are not checked.
        exclusive: the skills, as `component.skill`, of the components that execute one skill at a time.
    """
    if plot.dialect != "dsc":
        return []
    subject = Subject(plot, library, skills=None if skills is None else by_trigger(skills))
    checks = (
        _rules(subject), _handlers(subject), _transitions(subject), review_candidates(subject), review_names(subject),
        review_outcomes(subject), waiting_parts(subject, exclusive), review_motors(subject),
    )  # fmt: skip
    return list(islice(chain.from_iterable(checks), MAX_FINDINGS))


def _rules(subject: Subject) -> Iterator[Finding]:
    for number, rule in enumerate(subject.plot.rules):
        earlier = [one for one in subject.plot.rules[:number] if _comes_before(one, rule)]
        why = _never(rule.when, [one.when for one in earlier])
        if why is None and rule.on is not None and not subject.planned and _is_settled(subject, rule, rule.on):
            why = f"every state that can end with '{rule.on}' answers it itself"
        if why is not None:
            message = f"the rule '{rule.label}' can never answer: {why}{_earlier_text(earlier)}"
            yield subject.finding(("rules", number), "rules", message, _REMEDY, level="warning")


def _handlers(subject: Subject) -> Iterator[Finding]:
    """Yield warnings about handlers; interrupting and parallel handlers are independent and checked separately."""
    for number, handler in enumerate(subject.plot.handlers):
        same = (one for one in subject.plot.handlers[:number] if one.on == handler.on)
        earlier = [one for one in same if one.interrupt == handler.interrupt]
        why = _never(handler.when, [one.when for one in earlier])
        if why is None and handler.interrupt and handler.listen is None and _all_answer(handler.on, subject):
            why = f"every state answers '{handler.on}' itself"
        if why is not None:
            message = f"the '{handler.label}' can never answer: {why}{_earlier_text(earlier)}"
            yield subject.finding(("handlers", number), "handlers", message, _REMEDY, level="warning")
        if handler.do.use is not None:
            for event, used in _events_without_rule(subject, handler.do.use):
                message = f"the plot '{used}' plans with steps that end with '{event}', and has no rule for it"
                fix = f"repeat the rule of '{subject.plot.name}' there; without it, the goal is planned again"
                yield subject.finding(("handlers", number, "do", "use"), "handlers", message, fix, level="warning")
        if handler.do.use is not None and TIMED_OUT not in handler.do.on:
            for late in _late(subject.library, handler.do.use):
                message = f"{late} may time out, which then ends the run"
                fix = "add `on: {timed_out: resume}` here, or answer 'timed_out' there"
                yield subject.finding(("handlers", number, "do", "use"), "handlers", message, fix, level="warning")


def _events_without_rule(subject: Subject, used: str) -> Iterator[tuple[str, str]]:
    """Yield the outcomes of steps of plans that this plot has rules for and a planning plot in `used` has not."""
    library, plot = subject.library, subject.library.plot(used)
    if not subject.planned or not any(is_planned(state) for _, state, _ in plot.walk()):
        return
    ends = {event for one in library if one.implements for event in one.emits}
    answered = {rule.on for rule in plot.rules}
    for event in dict.fromkeys(rule.on for rule in subject.plot.rules):
        if event in ends and event not in answered and event is not None:
            yield event, used


def _late(library: Library, used: str) -> Iterator[str]:
    """Yield the calls with a written time limit in a plot, and in the plots that it uses, without an answer to it."""
    waiting, seen = [library.plot(used)], {used}
    while waiting:
        plot = waiting.pop()
        unanswered = [] if any(rule.on == TIMED_OUT for rule in plot.rules) else list(plot.walk())
        for name, state, _ in unanswered:
            if not isinstance(state, State) or TIMED_OUT in state.on:
                continue
            for action in flat(state.entry):
                if isinstance(action, Trigger) and action.within is not None:
                    yield f"'{action.trigger}' in state '{name}' of plot '{plot.name}'"
            if isinstance(state, Step) and not is_planned(state):
                waiting += [one for one in contents_of(state, library) if one.name not in seen]
                seen.update(one.name for one in waiting)


def _all_answer(event: str, subject: Subject) -> bool:
    """Return whether each interruptible state always handles the event itself."""
    resting = [state for _, state, _ in subject.states if isinstance(state, State)]
    own = [state for state in resting if not isinstance(state, CompositeState)]
    return all(any(not way.has_guard for way in state.on.get(event, ())) for state in own)


def _earlier_text(earlier: Sequence[Rule] | Sequence[Handler]) -> str:
    return "; before it: " + ", ".join(f"'{one.label}'" for one in earlier) if earlier else ""


def _comes_before(earlier: Rule, later: Rule) -> bool:
    """Return whether the later rule is not evaluated after a response of the earlier rule, regardless of its limit."""
    if (earlier.place, earlier.on) != (later.place, later.on):
        return False
    if earlier.steps and not (later.steps and set(later.steps) <= set(earlier.steps)):
        return False
    continues = {one.then for one in earlier.continuations} & _ONWARD.get(earlier.place, frozenset())
    return limit_of(earlier) is None and not continues


def _is_settled(subject: Subject, rule: Rule, event: str) -> bool:
    """Return whether the transitions of a rule's states always handle the rule's event."""
    mine = [state for name, state, _ in subject.steps if concerns(rule, name, state, subject.library)]
    able = [state for state in mine if event in answerable(state, subject.library)]
    return bool(able) and all(any(not way.has_guard for way in state.on.get(event, ())) for state in able)


def _transitions(subject: Subject) -> Iterator[Finding]:
    for name, _, path in subject.states:
        ways = [one for one in subject.leaving(path) if one[0][len(path)] in {"on", "always", "choice"}]
        for _, group in groupby(ways, key=lambda one: one[0][:-1]):
            guards: list[Expression | None] = []
            for here, trigger, way in group:
                why = _never(way.guard, guards)
                if why is not None:
                    which = f"transition on '{trigger}'" if here[len(path)] == "on" else "transition"
                    message = f"this {which} out of '{name}' is never taken: {why}"
                    yield subject.finding(here, "transitions", message, _REMEDY, level="warning")
                if not way.bind:  # else nothing may fulfil it
                    guards.append(way.guard)


def _never(condition: Expression | None, earlier: Sequence[Expression | None]) -> str | None:
    """Return the reason why an element after elements with the conditions `earlier` is never used, or `None`."""
    if condition is not None and contradictory(condition):
        return "its condition cannot hold"
    others = [Not(one or TRUE) for one in earlier]
    if None in earlier or (0 < len(others) <= MOST and contradictory(condition or TRUE, *others)):
        return "whenever its condition holds, one before it does"
    return None
