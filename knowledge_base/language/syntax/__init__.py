"""Conditions, terms and effects as frozen values, and their text."""
