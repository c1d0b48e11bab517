"""Supervision: keeps components alive and active while skills need them (registry, activation tree, supervisors)."""
