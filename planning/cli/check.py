"""Command `dsc check`: all static checks of a robot project, as one list."""

from __future__ import annotations

from typing import Annotated

import typer


def check_command(
    target: Annotated[
        str, typer.Argument(metavar="TARGET", help="A project folder, a plot, a Python file, or any robot.")
    ] = ".",
    json: Annotated[bool, typer.Option("--json", help="Print a JSON list of findings.")] = False,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings count, too.")] = False,
) -> None:
    """Check a whole project: PDDL, plots, profiles, components, goal and knowledge, and their agreement.

    Nothing is executed except the Python modules themselves. Exit status: 0 without findings, or with warnings only; 2
    with findings.
    """
    import logging

    from dsc.cli.plots import BAD_INPUT, print_findings
    from planning.robot.checking import check_project

    logging.disable()  # each programming error is a finding
    try:
        findings = check_project(target)
    finally:
        logging.disable(logging.NOTSET)
    print_findings([(target, finding) for finding in findings], as_json=json, nothing=f"{target}: no mistakes found")
    wrong = [finding for finding in findings if strict or finding.level == "error"]
    raise typer.Exit(BAD_INPUT if wrong else 0)
