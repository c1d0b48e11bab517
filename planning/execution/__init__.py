"""Execution of plans: monitoring, repair and replacement."""
