"""Ordering of plan steps: causal links between steps, and the partial order of the steps."""
