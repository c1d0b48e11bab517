"""Carrying plans out: watched, mended, replaced, given up."""
