"""The language's verbs on any `World`: ask, query, compute, apply, explain. The door to its evaluation."""

from __future__ import annotations

from knowledge_base.language.effect_application import apply_effect
from knowledge_base.language.evaluator import evaluate_argument, evaluate_term, holds, query
from knowledge_base.language.explanation import Explanation, explain
from knowledge_base.language.world import World

__all__ = ["Explanation", "World", "apply_effect", "evaluate_argument", "evaluate_term", "explain", "holds", "query"]
