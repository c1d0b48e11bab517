"""The command `dsc`: the commands of all rooms, and the reports of invalid input."""

from __future__ import annotations

import errno
import os
import sys
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from dsc.cli import plots
from dsc.cli.controllers import app as controllers_app
from dsc.cli.logs import PROGRAMMING_ERROR
from dsc.cli.monitor import monitor_command
from dsc.cli.runs import app as runs_app
from dsc.cli.runs import kept_relations
from dsc.cli.trees import app as trees_app
from dsc.cli.view import view_command
from dsc.cli.wire import call_command, ps_command
from knowledge_base.cli import app as kb_app
from knowledge_base.cli import register_reader, register_relations
from planning.cli import bundles_command, plan_command
from planning.cli.check import check_command
from planning.cli.deployment import app as deployment_app
from planning.cli.doctor import doctor_command
from planning.cli.host import host_command
from planning.cli.lsp import lsp_command
from planning.cli.new import new_command
from planning.cli.run import components_of_target, robot_knowledge, run_command
from planning.cli.wiring import wiring_command

if TYPE_CHECKING:
    from knowledge_base.errors import InputError

BAD_INPUT, NOT_WRITTEN, NO_READER = 2, 74, 141
"""Exit statuses of every command: bad input, EX_IOERR of sysexits.h, and a shell's status for a broken pipe."""

NO_FILE = frozenset({errno.ELOOP, errno.ENAMETOOLONG, errno.ENOTDIR, errno.EACCES, errno.EPERM})
"""Error numbers for a path that leads to no file, or to a file without permission."""


class _Commands(TyperGroup):
    """The group of commands; a closed pipe of the reader ends a command with `NO_READER`."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            raise typer.Exit(NO_READER) from None


app = typer.Typer(
    name="dsc",
    cls=_Commands,
    help="Dynamic State Charts: state charts for what you can foresee, a planner for what you cannot.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.add_typer(plots.app, name="plot")
app.add_typer(kb_app, name="kb")
app.add_typer(runs_app, name="runs")
app.add_typer(deployment_app, name="deployment")
app.add_typer(trees_app, name="tree")
app.add_typer(controllers_app, name="controller")
app.command("new")(new_command)
app.command("run")(run_command)
app.command("host")(host_command)
app.command("ps")(ps_command)
app.command("call")(call_command)
app.command("monitor")(monitor_command)
app.command("check")(check_command)
app.command("wiring")(wiring_command)
app.command("plan")(plan_command)
app.command("doctor")(doctor_command)
app.command("bundles")(bundles_command)
app.command("lsp")(lsp_command)
app.command("view")(view_command)
register_reader(robot_knowledge)
register_relations(kept_relations)
plots.register_targets(components_of_target)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"dsc {version('dynamic-state-charts')}")
        raise typer.Exit


@app.callback()
def dsc(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Dynamic State Charts: state charts for what you can foresee, a planner for what you cannot."""


def main() -> None:
    """Run the command line; report bad input as one message with exit status 2, and never as a traceback."""
    _open_standard_error()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a terminal may not support every character
            stream.reconfigure(errors="backslashreplace")
    try:
        _command()
    except BrokenPipeError:
        sys.exit(NO_READER)
    except OSError as error:
        from knowledge_base.output_files import FULL

        if error.errno not in FULL:
            raise
        named = "" if error.filename is None else f" '{error.filename}'"
        typer.echo(f"dsc: cannot write{named}: {error.strerror}", err=True)
        sys.exit(NOT_WRITTEN)
    finally:
        _drop_unwritten()


def _open_standard_error() -> None:
    """Open the null device in place of a closed standard error, which another file would take otherwise."""
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115  open until the end of the program


def _command() -> None:
    as_json = "--json" in sys.argv
    try:
        status = app(standalone_mode=not as_json)  # without --json, Typer itself reports wrong arguments
    except Exception as error:
        from dsc.errors import ProgrammingError
        from knowledge_base.errors import InputError

        wrong = _unusable(error) or (_misuse_error(error) if as_json else error)
        if isinstance(wrong, ProgrammingError):
            _tell(InputError(f"programming error in {wrong}"), as_json=as_json)
            sys.exit(PROGRAMMING_ERROR)
        if not isinstance(wrong, InputError):
            raise
        _tell(wrong, as_json=as_json)
        sys.exit(BAD_INPUT)
    sys.exit(status)


def _unusable(error: Exception) -> InputError | None:
    """Return the error for a path argument that the operating system refused; `None` for any other error."""
    from knowledge_base.errors import InputError

    if isinstance(error, RuntimeError) and isinstance(error.__context__, OSError):
        error = error.__context__  # Python 3.11 raises a RuntimeError for circular links
    if not isinstance(error, OSError) or error.errno not in NO_FILE or error.filename is None:
        return None
    return InputError(f"cannot use '{error.filename}': {error.strerror}", found=str(error.filename))


def _misuse_error(error: Exception) -> Exception:
    """Return an `InputError` for wrong arguments of a command; return any other error unchanged."""
    from knowledge_base.errors import InputError

    message = getattr(error, "format_message", None)
    if message is None:
        return error
    option, valid = getattr(error, "option_name", None), getattr(error, "possibilities", None) or ()
    said = f"no such option: {option}" if option else message().partition("\n")[0].removesuffix(".")
    return InputError(said, found=option, valid=valid)


def _tell(error: InputError, *, as_json: bool) -> None:
    """Print the error on standard error, or with --json as JSON on standard output."""
    import json

    from knowledge_base.errors import Place

    if not as_json:
        typer.echo(f"dsc: {error}", err=True)
        return
    place = error.place or Place()
    where = {"file": place.source, "line": place.line, "column": place.column}
    said = {"outcome": "bad_input", "message": error.message, **where, "found": error.found, "nearest": error.nearest}
    typer.echo(json.dumps(said))


def _drop_unwritten() -> None:
    """Discard unwritten output, so that Python reports no second error at its exit."""
    try:
        if sys.stdout is not None and not sys.stdout.closed:  # `None` if the process started without standard output
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
