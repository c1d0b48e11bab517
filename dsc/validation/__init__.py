"""Validation of plots before a run; each finding has file, line, violated rule and remedy."""

from dsc.validation.library import raise_findings, validate_library, validate_plot
from dsc.validation.review import review_plot

__all__ = ["raise_findings", "review_plot", "validate_library", "validate_plot"]
