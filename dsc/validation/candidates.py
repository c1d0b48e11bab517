"""Candidates that are never chosen, that overlap, or that leave gaps, as far as the form of their conditions tells."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

from dsc.dynamic.library import Library
from dsc.errors import Finding
from dsc.model.plot import ActionPlot
from dsc.model.states import DynamicState
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError
from knowledge_base.language.contradiction import contradictory, implied, subjects
from knowledge_base.language.expression import (
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
"""Candidates that are compared with each other; of states with more, nothing is said."""
Conditions = Mapping[str, Expression]
"""Candidates in their order, with their conditions over what all of them are handed."""


def review_candidates(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Warnings about the candidates of dynamic states, and about those for the steps of plans."""
    planned = False
    for name, state, path in nesting.states:
        if not isinstance(state, DynamicState):
            continue
        planned = planned or state.goal is not None
        conditions = {one: _condition(library.plot(one), state.arguments) for one in state.dynamic}
        if len(conditions) > MOST:
            continue
        for message in (*_never_chosen(conditions), *_overlapping(conditions)):
            error = SchemaError(f"state '{name}': {message}", place=plot.place((*path, "dynamic")))
            yield Finding(error, "candidates", "make their conditions exclude each other", "warning")
        if state.goal is None and _leave_a_gap(conditions):
            error = SchemaError(f"state '{name}': {_GAP}", place=plot.place((*path, "dynamic")))
            yield Finding(error, "candidates", "widen one of them, or add a last one without `when`", "warning")
    if planned:
        yield from _for_steps(library)


_GAP = "the conditions of its candidates leave a gap, where none of them fits"


def _for_steps(library: Library) -> Iterator[Finding]:
    """Overlaps are welcome there: when one has failed, another one is tried."""
    for action in dict.fromkeys(plot.implements for plot in library if plot.implements):
        plots = library.implementing(action)
        conditions = {plot.name: _condition(plot, plot.parameters) for plot in plots}
        if len(plots) <= MOST and _leave_a_gap(conditions):
            message = f"the plots for '{action}' leave a gap, where none of them fits: {', '.join(conditions)}"
            error = SchemaError(message, place=plots[-1].place(("when",)))
            yield Finding(error, "candidates", "widen one of them, or add one without `when`", "warning")


def _condition(plot: ActionPlot, given: Iterable[str]) -> Expression:
    """The plot's condition; what only this candidate has stands under a name of its own, or as its default."""
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
    """Pairs that look as if they were meant to exclude each other, as they are about the same things, and do not."""
    for (one, first), (other, second) in combinations(conditions.items(), 2):
        about = subjects(first)
        nested = implied(first, by=second) or implied(second, by=first)  # the special case before the general one
        if about and about == subjects(second) and not nested and not contradictory(first, second):
            yield f"the candidates '{one}' and '{other}' overlap: both can fit, and then '{one}' is chosen"


def _leave_a_gap(conditions: Conditions) -> bool:
    """Whether several candidates are about the same things, and together do not cover all cases."""
    many = list(conditions.values())
    about = {subjects(condition) for condition in many}
    if len(many) < 2 or len(about) != 1 or about == {frozenset()}:
        return False
    return not contradictory(*map(Not, many), *_counts(many))


def _counts(conditions: Sequence[Expression]) -> Iterator[Expression]:
    """What is only compared with numbers from 0 on is taken for a count, which is never below."""
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
