"""PDDL domain and problem files: the one reader of their outer form, and the writer of problems."""

from __future__ import annotations

from knowledge_base.exchange.domain_text import ActionText, DomainText, parse_domain, read_domain
from knowledge_base.exchange.problem_text import ProblemText, read_problem
from knowledge_base.exchange.problem_writing import problem_text

__all__ = ["ActionText", "DomainText", "ProblemText", "parse_domain", "problem_text", "read_domain", "read_problem"]
