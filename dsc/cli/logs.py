"""Log messages of a command on standard error, and the exit status after a programming error."""

from __future__ import annotations

from typing import Annotated

import typer

PROGRAMMING_ERROR = 3
"""Exit status of a run that ended with an exception of user code."""
Verbose = Annotated[
    int, typer.Option("--verbose", "-v", count=True, show_default=False, help="Log more: -v information, -vv details.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Log only errors, and print no progress.")]


def show_logs(verbose: int, *, quiet: bool) -> None:
    """Print log messages of the levels that the options ask for; without options, warnings and errors."""
    import logging

    level = logging.ERROR if quiet else (logging.WARNING, logging.INFO, logging.DEBUG)[min(verbose, 2)]
    logging.basicConfig(level=level, format="%(levelname)s %(name)s: %(message)s")
