"""Installed conditions and watches: a change evaluates only the conditions that it can affect (S2.4)."""
