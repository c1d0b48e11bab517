"""Robots: published bundles, their deployment with a simulated world, their static checks and reports."""
