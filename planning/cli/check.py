"""Command `dsc check`: all static checks of a robot project, as one list."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsc.cli.findings import JSON, SARIF, SELECT, STRICT, report
from dsc.cli.wire import REALM, Connect, Realm, ZenohFile, with_transport

if TYPE_CHECKING:
    from dsc.wire.remote import RemoteComponent
    from dsc.wire.zenoh_transport import ZenohTransport


def check_command(
    target: Annotated[
        str, typer.Argument(metavar="TARGET", help="A project folder, a plot, a Python file, or any robot.")
    ] = ".",
    json: JSON = False,
    sarif: SARIF = False,
    select: SELECT = None,
    strict: STRICT = False,
    hosts: Annotated[
        bool, typer.Option("--hosts", help="Compare with the components that other programs host now, too.")
    ] = False,
    realm: Realm = REALM,
    connect: Connect = None,
    zenoh: ZenohFile = None,
) -> None:
    """Check a whole project: PDDL, plots, profiles, components, goal and knowledge, and their agreement.

    Nothing is executed except the Python modules themselves. Exit status: 0 without findings, or with warnings only; 2
    with findings.
    """
    import logging

    asks = hosts or connect or zenoh is not None

    from dsc.cli.plots import BAD_INPUT
    from planning.robot.checking import check_project

    logging.disable()  # each programming error is a finding
    try:
        findings = check_project(target, _remote_of(target, realm, connect, zenoh) if asks else ())
    finally:
        logging.disable(logging.NOTSET)
    every, nothing = [(target, finding) for finding in findings], f"{target}: no mistakes found"
    wrong = report(every, nothing, json=json, sarif=sarif, selection=select, strict=strict)
    raise typer.Exit(BAD_INPUT if wrong else 0)


def _remote_of(target: str, realm: str, connect: list[str] | None, zenoh: Path | None) -> list[RemoteComponent]:
    """Return the components of other programs that a target uses; errors as for `dsc.wire.connect_all`."""
    from planning.robot.targets import bundle_at

    remote = bundle_at(target).remote

    async def connected(transport: ZenohTransport) -> list[RemoteComponent]:
        from dsc.wire.realm import connect_all

        return await connect_all(remote, transport)

    return with_transport(connected, realm, connect, zenoh) if remote else []
