"""Log records of runs: each has the robot and the run as `record.robot` and `record.run`."""

from __future__ import annotations

import logging
from contextvars import ContextVar

logged_run: ContextVar[tuple[str, str]] = ContextVar("logged_run", default=("", ""))
"""The name of the robot and the id of the run whose tasks execute; tasks that they begin inherit both."""


class RunFilter(logging.Filter):
    """A filter that gives each log record the attributes `robot` and `run`, which are empty outside of runs.

    Records of this library have them already. A handler with this filter adds them to records of skills, too.
    """

    def filter(self, record: logging.LogRecord) -> bool:
        """Set the attributes of the record, and return `True`."""
        record.robot, record.run = logged_run.get()
        return True


_FILTER = RunFilter()


def run_logger(name: str) -> logging.Logger:
    """Return the logger of that name, whose records have the attributes `robot` and `run`."""
    logger = logging.getLogger(name)
    logger.addFilter(_FILTER)
    return logger
