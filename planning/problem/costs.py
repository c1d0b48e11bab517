"""Plan metrics (PDDL `:metric`) as a cost of each ground action.

A metric is an action cost if it is a sum of numbers that actions only increase, by fixed amounts: `total-cost`, or `(+
(* 2 (fuel-used)) (tolls))`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from knowledge_base.language.syntax.expression import Arithmetic, Call, Term
from knowledge_base.language.syntax.text import to_text
from knowledge_base.pddl.problem_text import TOTAL_TIME
from planning.problem.relevance import names_of
from planning.quantities import Assignment, linear

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from knowledge_base.facts import Fact
    from knowledge_base.language.checking.vocabulary import Vocabulary
    from knowledge_base.pddl.problem_text import Metric
    from planning.problem.conditions import Grounder

TOTAL_COST = Call("total-cost")
"""The sum of action costs in PDDL; the default metric of a domain that declares it."""


def metric_of(metric: Metric | None, schema: Vocabulary) -> Term | None:
    """Return the term to minimize: by default `(total-cost)`, if it is declared."""
    if metric is not None:
        return metric.term if metric.direction == "minimize" else Arithmetic("-", (metric.term,))
    declared = schema.functions.get(TOTAL_COST.function)
    return TOTAL_COST if declared is not None and declared.arity == 0 else None


def ignored(metric: Term) -> str:
    """Return the note for a metric that is not an action cost."""
    if TOTAL_TIME.function in names_of(metric):
        return f"the metric {to_text(metric)} is ignored: one action at a time is planned for without regard to time"
    return f"the metric {to_text(metric)} is ignored: it is no sum of numbers that actions raise by fixed amounts"


@dataclass(frozen=True, slots=True)
class Costs:
    """Action costs.

    Attributes:
        coefficients: factor of each numeric fluent in the metric; `None` if the metric is not a linear sum.
    """

    coefficients: Mapping[Fact, float] | None

    @staticmethod
    def of(metric: Term | None, grounder: Grounder) -> Costs | None:
        """Return the costs by a metric; `None` without one."""
        if metric is None:
            return None
        declared = grounder.world.schema.functions
        known = all(name in declared for name in names_of(metric))  # PDDL has `total-time` without a declaration
        return Costs(linear(grounder.quantity(metric, {})) if known else None)

    def cost(self, assignments: Iterable[Assignment]) -> float | None:
        """Return the cost of an action with these effects; `None` if its change of the metric is not a cost."""
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
