"""PDDL domain and problem files: the one reader of their outer form."""

from __future__ import annotations

from knowledge_base.exchange.action_text import ActionText
from knowledge_base.exchange.domain_text import DomainText, parse_domain, read_domain
from knowledge_base.exchange.problem_text import Metric, ProblemText, read_problem

__all__ = ["ActionText", "DomainText", "Metric", "ProblemText", "parse_domain", "read_domain", "read_problem"]
