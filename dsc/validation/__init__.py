"""What must be true of plots before they run; every finding has file, line, rule and remedy."""

from dsc.validation.library import raise_findings, validate_library, validate_plot
from dsc.validation.review import review_plot

__all__ = ["raise_findings", "review_plot", "validate_library", "validate_plot"]
