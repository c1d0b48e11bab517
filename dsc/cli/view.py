"""Command `dsc view`: show a run in the browser.

Function `page` also shows the page of `dsc run --view`: it prints the address before the run has begun.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from knowledge_base.errors import InputError

if TYPE_CHECKING:
    from dsc.viewer.live import LivePage
    from dsc.viewer.records import RecordLog
    from dsc.viewer.server import Viewer

MOST_COMPLAINTS = 5
"""Maximum number of damaged records that are reported on the terminal; further ones are counted."""
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port on this machine; 0 picks a free one.")]
DataOption = Annotated[
    Path | None,
    typer.Option("--data", metavar="FOLDER", help="The folder of pictures and scans that the records name."),
]
NoOpen = Annotated[bool, typer.Option("--no-open", help="Only print the address.")]
P = TypeVar("P", "LivePage", "Viewer")


def view_command(
    file: Annotated[Path, typer.Argument(metavar="TRACE.jsonl|STORE", help="A trace or a store.")],
    port: Port = 0,
    no_open: NoOpen = False,
    data: DataOption = None,
) -> None:
    """Show a recorded run, or a store while other programs change it, in the browser until Ctrl-C."""
    viewer_installed()
    from dsc.viewer.access import PageAddress
    from dsc.viewer.record_sources import records_of
    from dsc.viewer.server import Viewer

    with records_of(file) as log:
        complain(file, log)
        with page(Viewer(log, PageAddress.on(port), data=data), opens=not no_open) as viewer:
            until_interrupt(viewer)


@contextmanager
def page(shown: P, *, opens: bool) -> Iterator[P]:
    """Show a page in a browser during the block; print its address first."""
    shown.start()
    typer.echo(shown.url)
    if opens:
        import webbrowser

        with suppress(webbrowser.Error):  # the address is printed, so that people can open it themselves
            webbrowser.open(shown.one_time_url)
    try:
        yield shown
    finally:
        shown.close()


def until_interrupt(viewer: LivePage | Viewer) -> None:
    """Serve the page until Ctrl-C."""
    typer.echo("Ctrl-C ends it", err=True)
    try:
        viewer.wait()
    except KeyboardInterrupt:
        typer.echo("", err=True)


def viewer_installed() -> None:
    """Raise `InputError` unless the packages of the extra `viewer` are installed."""
    from importlib.util import find_spec

    missing = [name for name in ("starlette", "uvicorn", "websockets") if find_spec(name) is None]
    if missing:
        raise InputError(f"the viewer needs {', '.join(missing)}: pip install {' '.join(missing)}", found=missing[0])


def complain(file: Path, log: RecordLog) -> None:
    """Report on the terminal the damaged records, which the page cannot show."""
    for complaint in log.complaints[:MOST_COMPLAINTS]:
        typer.echo(complaint, err=True)
    if (more := len(log.complaints) - MOST_COMPLAINTS) > 0:
        typer.echo(f"{file}: {more} more records are damaged", err=True)
    if not log.live and len(log) == 0:
        typer.echo(f"{file}: there are no records", err=True)
