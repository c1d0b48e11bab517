"""Kept runs: one transaction per macrostep in the file of the knowledge, with every value that a restart needs."""
