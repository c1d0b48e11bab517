"""Execution of plans: monitoring, repair, replacement, and giving up."""
