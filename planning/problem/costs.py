"""What a plan shall cost as little as possible (PDDL `:metric`), as a cost of each ground action.

A metric is an action cost when it is a sum of numbers that actions only raise, and by amounts that do not change:
`total-cost`, or `(+ (* 2 (fuel-used)) (tolls))`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from knowledge_base.language.expression import Arithmetic, Call, Term
from knowledge_base.language.printer import to_text
from knowledge_base.pddl.problem_text import TOTAL_TIME
from planning.problem.relevance import names_of
from planning.quantities import Assignment, linear

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from knowledge_base.facts import Fact
    from knowledge_base.language.vocabulary import Vocabulary
    from knowledge_base.pddl.problem_text import Metric
    from planning.problem.conditions import Grounder

TOTAL_COST = Call("total-cost")
"""What PDDL calls the sum of action costs; the metric of a domain that declares it, unless another is asked for."""


def metric_of(metric: Metric | None, schema: Vocabulary) -> Term | None:
    """What plans shall have as little of as possible: by default `(total-cost)`, if it is declared."""
    if metric is not None:
        return metric.term if metric.direction == "minimize" else Arithmetic("-", (metric.term,))
    declared = schema.functions.get(TOTAL_COST.function)
    return TOTAL_COST if declared is not None and declared.arity == 0 else None


def ignored(metric: Term) -> str:
    """The note for a metric that is no action cost."""
    if TOTAL_TIME.function in names_of(metric):
        return f"the metric {to_text(metric)} is ignored: one action at a time is planned for without regard to time"
    return f"the metric {to_text(metric)} is ignored: it is no sum of numbers that actions raise by fixed amounts"


@dataclass(frozen=True, slots=True)
class Costs:
    """Action costs.

    Attributes:
        coefficients: of each numeric fluent in the metric; `None` if the metric is no sum of fluents.
    """

    coefficients: Mapping[Fact, float] | None

    @staticmethod
    def of(metric: Term | None, grounder: Grounder) -> Costs | None:
        """The costs that a metric stands for; `None` without one."""
        if metric is None:
            return None
        declared = grounder.world.schema.functions
        known = all(name in declared for name in names_of(metric))  # PDDL has `total-time` without a declaration
        return Costs(linear(grounder.quantity(metric, {})) if known else None)

    def cost(self, assignments: Iterable[Assignment]) -> float | None:
        """What an action with these effects costs; `None` if it changes the metric in another way than a cost."""
        if self.coefficients is None:
            return None
        total = 0.0
        for one in assignments:
            coefficient = self.coefficients.get(one.fluent, 0.0)
            if coefficient and not (one.increase and isinstance(one.amount, int | float)):
                return None
            if coefficient and isinstance(one.amount, int | float):
                total += coefficient * one.amount
        return total if total >= 0 else None
