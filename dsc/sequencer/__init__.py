"""Sequencer: executes a chart by handling events, running macrosteps and sending actions to components (S0.8).

The sequencer itself computes no result of a skill, and never blocks.
"""
