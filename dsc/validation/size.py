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
    if not plot.rules:
        return
    answered = Counter(event for _, state, _ in nesting.states for event in answerable(state, library))
    steps = sum(isinstance(state, Step) for _, state, _ in nesting.states)
    each = [_answers(rule, answered[rule.on] if rule.on is not None else steps, nesting) for rule in plot.rules]
    if sum(each) > MAX_ANSWERS:
        message = f"the rules would make {sum(each)} transitions; at most {MAX_ANSWERS} are made"
        error = SchemaError(message, place=plot.place(("rules",)))
        yield Finding(error, "bounded rules", "say with `of` for which states a rule is")


def _answers(rule: Rule, at_most: int, nesting: Nesting) -> int:
    """How many states it answers for, as far as that shows without looking at each."""
    by_state = rule.steps and all(name in nesting.names for name in rule.steps)
    return min(at_most, len(rule.steps)) if by_state else at_most
