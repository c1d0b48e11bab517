"""Monitoring: selected information about components, periodically or at each change, by a profile (S1.19)."""
