"""Runs a chart: events in, macrosteps, actions out to components; never computes and never blocks (S0.8)."""
