"""Conditions that are installed and watched: evaluated when something changes, where it changes (S2.4)."""
