"""Controllers of plots: one Python module or one C99 file, which needs nothing of this package (S3.4, S3.8)."""

from dsc.controllers.targets import TARGETS, build_controller

__all__ = ["TARGETS", "build_controller"]
