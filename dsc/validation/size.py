"""Rules that would make too many transitions: each rule answers each outcome of each state that it is for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from dsc.dynamic.library import Library
from dsc.dynamic.outcomes import answerable
from dsc.dynamic.steps import Step
from dsc.errors import Finding
from dsc.model.plot import ActionPlot
from dsc.model.rules import Rule
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError

MAX_ANSWERS = 1_000
"""Transitions made of rules; ten times what the largest plot we ship has, and made in a tenth of a second."""


def check_size(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """A finding if carrying out the plot's rules would take too long."""
    if not plot.rules and not plot.handlers:
        return
    answered = Counter(event for _, state, _ in nesting.states for event in answerable(state, library))
    steps = sum(isinstance(state, Step) for _, state, _ in nesting.states)
    made = sum(_answers(rule, answered[rule.on] if rule.on is not None else steps, nesting) for rule in plot.rules)
    made += sum(bool(rule.before) for rule in plot.rules) * _passing(nesting)  # each has a way of its own
    made += sum(handler.interrupt for handler in plot.handlers) * len(nesting.states)
    if made > MAX_ANSWERS:
        what = "rules and handlers" if plot.rules and plot.handlers else "rules" if plot.rules else "handlers"
        message = f"the {what} would make {made} transitions; at most {MAX_ANSWERS} are made"
        error = SchemaError(message, place=plot.place(("rules",) if plot.rules else ("handlers",)))
        yield Finding(error, "bounded rules", "say with `of` for which states a rule is")


def _passing(nesting: Nesting) -> int:
    """How many transitions pass arguments."""
    return sum(bool(way.passed) for _, _, path in nesting.states for _, _, way in nesting.leaving(path))


def _answers(rule: Rule, at_most: int, nesting: Nesting) -> int:
    """How many states it answers for, as far as that shows without looking at each."""
    by_state = rule.steps and all(name in nesting.names for name in rule.steps)
    return min(at_most, len(rule.steps)) if by_state else at_most
