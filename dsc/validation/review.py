"""Review of a plot: warnings about parts that are never used, and about candidates that overlap or leave gaps."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain, combinations, groupby, islice

from dsc.dynamic.library import Library
from dsc.dynamic.responses import limit_of
from dsc.dynamic.steps import Step, answerable, concerns, contents_of, is_planned
from dsc.errors import Finding
from dsc.events import TIMED_OUT
from dsc.model.actions import Trigger, flat
from dsc.model.plot import ActionPlot, Path
from dsc.model.rules import CONTINUE, ENTER, Handler, Rule
from dsc.model.states import CompositeState, DynamicState, State
from dsc.validation.library import MAX_FINDINGS
from dsc.validation.subject import Subject
from dsc.validation.turns import waiting_parts
from knowledge_base.errors import SchemaError
from knowledge_base.language.checking.contradiction import contradictory, implied, subjects
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.syntax.expression import (
    TRUE,
    Call,
    Comparison,
    Constant,
    Expression,
    Not,
    Term,
    Variable,
    free_variables,
    parts_of,
    substitute,
)

MOST = 32
"""Upper bound of conditions that are compared with each other.

States with more candidates are skipped. Of a longer list of guards, each later guard is checked alone.
"""
Conditions = Mapping[str, Expression]
"""Conditions over the common parameters, by candidate, in the order of candidates."""


_REMEDY = "remove it, or change its condition"
_ONWARD = {"before": frozenset({ENTER}), "after": frozenset({CONTINUE})}
"""Continuations that lead to the next rule of the step, by the place of the rule."""


def _candidates(subject: Subject) -> Iterator[Finding]:
    """Yield warnings about the candidates of dynamic states, and about the candidates for steps of plans."""
    for name, state, path in subject.steps:
        if not isinstance(state, DynamicState) or len(state.dynamic) > MOST:
            continue
        conditions = {one: _condition(subject.library.plot(one), state.arguments) for one in state.dynamic}
        for message in (*_never_chosen(conditions), *_overlapping(conditions)):
            yield _unclear(subject, name, path, message, "make their conditions exclude each other")
    if subject.planned:
        yield from _for_steps(subject.library)


def _unclear(subject: Subject, name: str, path: Path, message: str, fix: str) -> Finding:
    here, message = (*path, "dynamic"), f"state '{name}': {message}"
    return subject.finding(here, "candidates", message, fix, level="warning")


def _for_steps(library: Library) -> Iterator[Finding]:
    """Yield warnings about gaps between implementations of a planning action.

    Overlaps are allowed, because another implementation is tried if the first one fails.
    """
    for action in dict.fromkeys(plot.implements for plot in library if plot.implements):
        plots = library.implementing(action)
        conditions = {plot.name: _condition(plot, plot.parameters) for plot in plots}
        if len(plots) <= MOST and _leave_a_gap(conditions):
            message = f"the plots for '{action}' leave a gap, where none of them fits: {', '.join(conditions)}"
            error = SchemaError(message, place=plots[-1].place(("when",)))
            yield Finding(error, "candidates", "widen one of them, or add one without `when`", "warning")


def _condition(plot: ActionPlot, given: Iterable[str]) -> Expression:
    """Return the plot's condition; a default or a unique name replaces each parameter that is not in `given`."""
    own: dict[str, Term] = {}
    for name in free_variables(plot.when or TRUE) - set(given):
        default = plot.parameters[name].default if name in plot.parameters else None
        own[name] = default if isinstance(default, Constant) else Variable(f"{plot.name}.{name}")
    return substitute(plot.when or TRUE, own)


def _never_chosen(conditions: Conditions) -> Iterator[str]:
    earlier: list[Expression] = []
    for name, condition in conditions.items():
        if contradictory(condition):
            yield f"the candidate '{name}' is never chosen: its condition cannot hold"
        elif earlier and contradictory(condition, *map(Not, earlier)):
            yield f"the candidate '{name}' is never chosen: whenever it fits, one before it does"
        earlier.append(condition)


def _overlapping(conditions: Conditions) -> Iterator[str]:
    """Yield pairs of candidates that overlap although they read equal facts, which suggests exclusive conditions."""
    for (one, first), (other, second) in combinations(conditions.items(), 2):
        about = subjects(first)
        nested = implied(first, by=second) or implied(second, by=first)  # a special case may precede the general case
        if about and about == subjects(second) and not nested and not contradictory(first, second):
            yield f"the candidates '{one}' and '{other}' overlap: both can fit, and then '{one}' is chosen"


def _leave_a_gap(conditions: Conditions) -> bool:
    """Return whether several candidates read equal facts, and their conditions do not cover all cases."""
    many = list(conditions.values())
    about = {subjects(condition) for condition in many}
    if len(many) < 2 or len(about) != 1 or about == {frozenset()} or _by_name(many):
        return False
    return not contradictory(*map(Not, many), *_counts(many))


def _by_name(conditions: Iterable[Expression]) -> bool:
    """Return whether each condition compares one variable with a name, e.g. `(= ?arm left)`, which leaves no gap."""
    return bool(set.intersection(*(set(_named(conjuncts(one))) for one in conditions)))


def _named(parts: Iterable[Expression]) -> Iterator[Term]:
    """Yield each variable that a part equates with a name."""
    for part in parts:
        match part:
            case Comparison("=", Variable() as variable, Constant(str())):
                yield variable
            case _:
                pass


def _counts(conditions: Sequence[Expression]) -> Iterator[Expression]:
    """Yield the condition `>= 0` for each term that is compared only with numbers of at least 0, e.g. a count."""
    compared: dict[Call, list[Constant]] = {}
    for comparison in _comparisons(conditions):
        for term, other in ((comparison.left, comparison.right), (comparison.right, comparison.left)):
            if isinstance(term, Call) and isinstance(other, Constant):
                compared.setdefault(term, []).append(other)
    for term, constants in compared.items():
        if all(isinstance(one.value, int | float) and one.value >= 0 for one in constants):
            yield Comparison(">=", term, Constant(0))


def _comparisons(parts: Iterable[Expression | Term]) -> Iterator[Comparison]:
    for part in parts:
        if isinstance(part, Comparison):
            yield part
        elif not isinstance(part, Term):
            yield from _comparisons(parts_of(part))


def review_plot(plot: ActionPlot, library: Library, exclusive: Collection[str] = ()) -> list[Finding]:
    """Return at most `MAX_FINDINGS` warnings about a plot for which `validate_plot` returns no finding.

    Args:
        plot: the plot.
        library: the plots that it may use.
        exclusive: the skills, as `component.skill`, of the components that execute one skill at a time.
    """
    if plot.dialect != "dsc":
        return []
    subject = Subject(plot, library)
    checks = (_rules(subject), _handlers(subject), _transitions(subject), _candidates(subject),
              waiting_parts(subject, exclusive))  # fmt: skip
    return list(islice(chain.from_iterable(checks), MAX_FINDINGS))


def _rules(subject: Subject) -> Iterator[Finding]:
    for number, rule in enumerate(subject.plot.rules):
        earlier = [one for one in subject.plot.rules[:number] if _comes_before(one, rule)]
        why = _never(rule.when, [one.when for one in earlier])
        if why is None and rule.on is not None and not subject.planned and _settled(subject, rule, rule.on):
            why = f"every state that can end with '{rule.on}' answers it itself"
        if why is not None:
            message = f"the rule '{rule.label}' can never answer: {why}{_listed(earlier)}"
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
            message = f"the '{handler.label}' can never answer: {why}{_listed(earlier)}"
            yield subject.finding(("handlers", number), "handlers", message, _REMEDY, level="warning")
        if handler.do.use is not None and TIMED_OUT not in handler.do.on:
            for late in _late(subject.library, handler.do.use):
                message = f"{late} may time out, which then ends the run"
                fix = "add `on: {timed_out: resume}` here, or answer 'timed_out' there"
                yield subject.finding(("handlers", number, "do", "use"), "handlers", message, fix, level="warning")


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
    return all(any(way.guard is None for way in state.on.get(event, ())) for state in own)


def _listed(earlier: Sequence[Rule] | Sequence[Handler]) -> str:
    return "; before it: " + ", ".join(f"'{one.label}'" for one in earlier) if earlier else ""


def _comes_before(earlier: Rule, later: Rule) -> bool:
    """Return whether the later rule is not evaluated after a response of the earlier rule, regardless of its limit."""
    if (earlier.place, earlier.on) != (later.place, later.on):
        return False
    if earlier.steps and not (later.steps and set(later.steps) <= set(earlier.steps)):
        return False
    continues = {one.then for one in earlier.continuations} & _ONWARD.get(earlier.place, frozenset())
    return limit_of(earlier) is None and not continues


def _settled(subject: Subject, rule: Rule, event: str) -> bool:
    """Return whether the transitions of a rule's states always handle the rule's event."""
    mine = [state for name, state, _ in subject.steps if concerns(rule, name, state, subject.library)]
    able = [state for state in mine if event in answerable(state, subject.library)]
    return bool(able) and all(any(way.guard is None for way in state.on.get(event, ())) for state in able)


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
                guards.append(way.guard)


def _never(condition: Expression | None, earlier: Sequence[Expression | None]) -> str | None:
    """Return the reason why an element after elements with the conditions `earlier` is never used, or `None`."""
    if condition is not None and contradictory(condition):
        return "its condition cannot hold"
    others = [Not(one or TRUE) for one in earlier]
    if None in earlier or (0 < len(others) <= MOST and contradictory(condition or TRUE, *others)):
        return "whenever its condition holds, one before it does"
    return None
