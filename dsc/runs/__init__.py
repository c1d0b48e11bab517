"""Kept runs: one transaction a macrostep in the file of the knowledge, with everything that a restart needs."""
