"""Evaluation of conditions, terms and effects on a world: truth, answers, values, changes, explanations."""
