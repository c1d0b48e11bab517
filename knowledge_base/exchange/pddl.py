"""PDDL domain and problem files: how they are read, and how a world is written as one."""

from __future__ import annotations

from knowledge_base.exchange.problem_text import Metric, ProblemText, parse_problem, read_problem
from knowledge_base.exchange.problem_writer import problem_to_text
from knowledge_base.pddl.action_text import ActionText
from knowledge_base.pddl.domain_text import DomainText, parse_domain, read_domain

__all__ = [
    "ActionText", "DomainText", "Metric", "ProblemText", "parse_domain", "parse_problem", "problem_to_text",
    "read_domain", "read_problem",
]  # fmt: skip
