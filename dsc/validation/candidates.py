"""Review of candidates: warnings about those that overlap, are never chosen, or leave a gap."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

from dsc.data_types import data_type
from dsc.dynamic.library import Library
from dsc.dynamic.steps import candidates_of
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import DynamicState
from dsc.validation.subject import Subject
from knowledge_base.errors import SchemaError
from knowledge_base.facts import Value
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
from knowledge_base.spelling import value_text

MOST = 32
"""Upper bound of conditions that are compared with each other.

States with more candidates are skipped. Of a longer list of guards, each later guard is checked alone.
"""
Conditions = Mapping[str, Expression]
"""Conditions over the common parameters, by candidate, in the order of candidates."""


def review_candidates(subject: Subject) -> Iterator[Finding]:
    """Yield warnings about the candidates of dynamic states, and about the candidates for steps of plans."""
    for name, state, path in subject.steps:
        plots = candidates_of(state, subject.library) if isinstance(state, DynamicState) else []
        if not isinstance(state, DynamicState) or len(plots) > MOST:
            continue
        yield from _without_score(subject, name, state, path, plots)
        conditions = {plot.name: _condition(plot, state.arguments) for plot in plots}
        for message in (*_never_chosen(conditions, state), *_overlapping(conditions, state)):
            yield _unclear(subject, name, path, message, "make their conditions exclude each other")
        for message in _values_without_candidate(conditions, plots) if state.goal is None else ():
            yield _unclear(subject, name, path, message, "add a candidate for it")
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


def _without_score(
    subject: Subject, name: str, state: DynamicState, path: Path, plots: Sequence[ActionPlot]
) -> Iterator[Finding]:
    """Yield warnings about candidates without the term by which their state chooses, and about needless exploration."""
    if state.explore and state.choose != "learned":
        message = f"state '{name}' explores, and it does not choose by experience"
        yield subject.finding((*path, "explore"), "candidates", message, "write `choose: learned`", level="warning")
    for number, plot in enumerate(plots):
        if state.choose not in {"order", "learned"} and state.choose not in plot.scores():
            message = (
                f"state '{name}' chooses by {state.choose}, and the candidate '{plot.name}' has no `{state.choose}`"
            )
            fix = f"write `{state.choose}` in the plot; without it, the candidate comes last"
            yield subject.finding((*path, "dynamic", number), "candidates", message, fix, level="warning")


def _never_chosen(conditions: Conditions, state: DynamicState) -> Iterator[str]:
    earlier: list[Expression] = []
    for name, condition in conditions.items():
        if contradictory(condition):
            yield f"the candidate '{name}' is never chosen: its condition cannot hold"
        elif earlier and state.choose == "order" and contradictory(condition, *map(Not, earlier)):
            yield f"the candidate '{name}' is never chosen: whenever it fits, one before it does"
        earlier.append(condition)


def _overlapping(conditions: Conditions, state: DynamicState) -> Iterator[str]:
    """Yield pairs of candidates that overlap although they read equal facts, which suggests exclusive conditions."""
    pairs = combinations(conditions.items(), 2) if state.choose == "order" else ()
    for (one, first), (other, second) in pairs:
        about = subjects(first)
        nested = implied(first, by=second) or implied(second, by=first)  # a special case may precede the general case
        if about and about == subjects(second) and not nested and not contradictory(first, second):
            yield f"the candidates '{one}' and '{other}' overlap: both can fit, and then '{one}' is chosen"


def _values_without_candidate(conditions: Conditions, plots: Iterable[ActionPlot]) -> Iterator[str]:
    """Yield the values of a parameter for which no candidate fits, if all conditions only compare these values."""
    values = {f"?{name}": found for plot in plots for name, found in _values(plot).items()}
    about = {subjects(condition) for condition in conditions.values()}
    read = about.pop() if len(about) == 1 else frozenset()
    if len(read) != 1 or not read <= values.keys():
        return
    (variable,) = read
    for value in values[variable]:
        is_value = Comparison("=", Variable(variable[1:]), Constant(value))
        if not contradictory(is_value, *map(Not, conditions.values())):
            yield f"no candidate fits if {variable} is {value_text(value)}"


def _values(plot: ActionPlot) -> dict[str, tuple[Value, ...]]:
    """Return the values of each parameter whose type has few values: a choice or a truth value."""
    found: dict[str, tuple[Value, ...]] = {}
    for name, parameter in plot.parameters.items():
        kind = data_type(parameter.type)
        if kind.kind in {"choice", "boolean"}:
            found[name] = kind.values or (True, False)
    return found


def _leave_a_gap(conditions: Conditions) -> bool:
    """Return whether several candidates read equal facts, and their conditions do not cover all cases."""
    many = list(conditions.values())
    about = {subjects(condition) for condition in many}
    if len(many) < 2 or len(about) != 1 or about == {frozenset()} or _by_name(many):
        return False
    return not contradictory(*map(Not, many), *_counts(many))


def _by_name(conditions: Iterable[Expression]) -> bool:
    """Return whether each condition compares one variable with a name, e.g. `(= ?arm left)`, which leaves no gap."""
    return bool(set.intersection(*(set(_find_named(conjuncts(one))) for one in conditions)))


def _find_named(parts: Iterable[Expression]) -> Iterator[Term]:
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
