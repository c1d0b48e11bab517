"""PDDL domain and problem files as values: read, checked and written."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from knowledge_base.pddl.action_text import ActionText as ActionText
    from knowledge_base.pddl.domain_text import DomainText as DomainText
    from knowledge_base.pddl.domain_text import parse_domain as parse_domain
    from knowledge_base.pddl.domain_text import read_domain as read_domain
    from knowledge_base.pddl.problem_text import Metric as Metric
    from knowledge_base.pddl.problem_text import ProblemText as ProblemText
    from knowledge_base.pddl.problem_text import parse_problem as parse_problem
    from knowledge_base.pddl.problem_text import read_problem as read_problem
    from knowledge_base.pddl.problem_writer import problem_to_text as problem_to_text

__getattr__, __dir__, __all__ = lazy_exports(
    __name__,
    {
        "ActionText": "action_text",
        "DomainText": "domain_text",
        "Metric": "problem_text",
        "ProblemText": "problem_text",
        "parse_domain": "domain_text",
        "parse_problem": "problem_text",
        "problem_to_text": "problem_writer",
        "read_domain": "domain_text",
        "read_problem": "problem_text",
    },
)
