"""Types of terms: a function of the world and a geometry have the type of their values."""

from __future__ import annotations

import pytest
from dsc_charts import plot

from dsc.dynamic.library import Library
from dsc.validation import validate_plot
from planning.model.domain import PlanningDomain

SCHEMA = PlanningDomain.from_fragments(
    ["""(define (domain d) (:types item) (:constants cup - item)
      (:functions (pose ?i - item) - geometry (label ?i - item) - text (mass ?i - item) - number (clean ?i - item) - boolean))"""]
).schema  # fmt: skip
TERMS = {
    "(pose cup)": "geometry", "(label cup)": "text", "(mass cup)": "number", "(clean cup)": "boolean",
    "(geometry 1 2)": "geometry", "(+ 1 (mass cup))": "number",
}  # fmt: skip


@pytest.mark.parametrize("declared", ["geometry", "text", "number", "boolean"])
@pytest.mark.parametrize(("term", "kind"), TERMS.items())
def test_a_term_enters_only_a_variable_of_its_type(term, kind, declared):
    made = plot(f"""
        plot: p
        variables: {{x: {{type: {declared}}}}}
        states: {{s: {{after: {{seconds: 1, to: e, assign: {{x: {term}}}}}}}, e: {{final: true}}}}
    """)
    found = [str(one) for one in validate_plot(made, Library([made]), SCHEMA)]
    if declared == kind:
        assert found == []
    else:
        assert f"'x' is of type {declared}, and {term} is of type {kind}" in "\n".join(found)
