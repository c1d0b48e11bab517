"""Skeletons of components in typed Python, made from the plots that use them (S1.16, S4.12)."""
