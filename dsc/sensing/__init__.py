"""Conditions over several sources: each part is evaluated at its source, and only changes of its truth travel."""
