"""Supervision keeps the components alive and active that skills need: registry, activation tree, supervisors."""
