"""Command `dsc check`: all static checks of a robot project, as one list."""

from __future__ import annotations

from typing import Annotated

import typer

from dsc.cli.findings import JSON, SARIF, SELECT, STRICT, report


def check_command(
    target: Annotated[
        str, typer.Argument(metavar="TARGET", help="A project folder, a plot, a Python file, or any robot.")
    ] = ".",
    json: JSON = False,
    sarif: SARIF = False,
    select: SELECT = None,
    strict: STRICT = False,
) -> None:
    """Check a whole project: PDDL, plots, profiles, components, goal and knowledge, and their agreement.

    Nothing is executed except the Python modules themselves. Exit status: 0 without findings, or with warnings only; 2
    with findings.
    """
    import logging

    from dsc.cli.plots import BAD_INPUT
    from planning.robot.checking import check_project

    logging.disable()  # each programming error is a finding
    try:
        findings = check_project(target)
    finally:
        logging.disable(logging.NOTSET)
    every, nothing = [(target, finding) for finding in findings], f"{target}: no mistakes found"
    wrong = report(every, nothing, json=json, sarif=sarif, selection=select, strict=strict)
    raise typer.Exit(BAD_INPUT if wrong else 0)
