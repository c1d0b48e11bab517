"""Robots: published bundles, deployed robots with their simulated worlds, static checks and reports."""
