"""Command `dsc view`, and the page of `dsc run --view`: its address is printed before the content exists."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol, TypeVar

import typer

if TYPE_CHECKING:
    from dsc.viewer.records import RecordLog

MOST_COMPLAINTS = 5
"""Upper bound of damaged records named on the terminal; the rest is counted."""
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port on this machine; 0 picks a free one.")]
NoOpen = Annotated[bool, typer.Option("--no-open", help="Only print the address.")]


def view_command(
    file: Annotated[Path, typer.Argument(metavar="TRACE.jsonl|STORE", help="A trace or a store.")],
    port: Port = 0,
    no_open: NoOpen = False,
) -> None:
    """Look at a recorded run, or at a store as others change it, in the browser; Ctrl-C ends it."""
    viewer_installed()
    from dsc.viewer.address import PageAddress
    from dsc.viewer.record_sources import records_of
    from dsc.viewer.server import Viewer

    with records_of(file) as log:
        _complain(file, log)
        with page(Viewer(log, PageAddress.on(port)), opens=not no_open) as viewer:
            until_interrupt(viewer)


def _complain(file: Path, log: RecordLog) -> None:
    """Name on the terminal the records that the page cannot show."""
    for complaint in log.complaints[:MOST_COMPLAINTS]:
        typer.echo(complaint, err=True)
    if (more := len(log.complaints) - MOST_COMPLAINTS) > 0:
        typer.echo(f"{file}: {more} more records are damaged", err=True)
    if not log.live and len(log) == 0:
        typer.echo(f"{file}: there are no records", err=True)


class Page(Protocol):
    """A page that answers at an address from `start` to `close`."""

    @property
    def url(self) -> str:
        """The address for people, to be printed."""

    @property
    def one_time_url(self) -> str:
        """The address for a browser's command line."""

    def start(self) -> None:
        """Start answering."""

    def wait(self) -> None:
        """Wait until the page is closed; an interrupt gets through."""

    def close(self) -> None:
        """Stop answering."""


P = TypeVar("P", bound=Page)


@contextmanager
def page(shown: P, *, opens: bool) -> Iterator[P]:
    """Show a page in a browser during the block; print its address first."""
    shown.start()
    typer.echo(shown.url)
    if opens:
        import webbrowser

        with suppress(webbrowser.Error):  # the address is printed: people can open it themselves
            webbrowser.open(shown.one_time_url)
    try:
        yield shown
    finally:
        shown.close()


def until_interrupt(viewer: Page) -> None:
    """Serve the page until Ctrl-C."""
    typer.echo("Ctrl-C ends it", err=True)
    try:
        viewer.wait()
    except KeyboardInterrupt:
        typer.echo("", err=True)


def viewer_installed() -> None:
    """Raise `InputError` unless the extra is installed."""
    from importlib.util import find_spec

    from knowledge_base.errors import InputError

    missing = [name for name in ("starlette", "uvicorn", "websockets") if find_spec(name) is None]
    if missing:
        raise InputError(
            f"the viewer needs {', '.join(missing)}: pip install 'dynamic-state-charts[viewer]'", found=missing[0]
        )
