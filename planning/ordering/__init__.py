"""Causal links between the steps of a plan, and the partial order of the steps."""
