"""Conditions, terms and effects as immutable values, and their text."""
