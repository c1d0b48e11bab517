"""Command `dsc plot rename`: another name at all places of a project's texts."""

from __future__ import annotations

from difflib import unified_diff
from pathlib import Path
from typing import Annotated

import typer

from knowledge_base.cli.console import print_json
from knowledge_base.spelling import number_text


def rename_command(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="plot, candidate, state, parameter, variable, outcome, event, offer, predicate, function, type, object"
            " or action.",
        ),
    ],
    old: Annotated[str, typer.Argument(metavar="OLD", help="The name; PLOT.NAME if several plots have it.")],
    new: Annotated[str, typer.Argument(metavar="NEW", help="The new name.")],
    project: Annotated[Path, typer.Option("--project", metavar="FOLDER", help="The folder of the project.")] = Path(),
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the difference, and write nothing.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print a JSON object.")] = False,
) -> None:
    """Rename a name in the plots, profiles, scenarios and PDDL files of a project; report the places in Python code.

    Lines without the name keep their bytes, and Python code is not changed.
    """
    from dsc.editing.renaming import rename_named
    from knowledge_base.output_files import Output, write_all
    from knowledge_base.pddl.unsaved_texts import readable_text

    found, texts = rename_named(project, kind, old, new)
    shown = {file: _difference(file, readable_text(file), text) for file, text in texts.items()}
    if not dry_run:
        write_all({Output(file, "OLD"): _with_line_ends(file, text) for file, text in texts.items()})
    if json:
        places = {"python": found.in_python, "texts": found.in_texts}
        left = {key: [{"file": str(file), "line": line} for file, line in lines] for key, lines in places.items()}
        print_json({"files": {str(file): lines for file, lines in shown.items()}, **left})
        return
    for file, edits in found.edits.items():
        typer.echo(shown[file] if dry_run else f"{file}: {number_text(len(edits), 'place')}", nl=not dry_run)
    for file, line in found.in_python:
        typer.echo(f"{file}:{line}: Python code has this name, too; change it there yourself")
    for file, line in found.in_texts:
        typer.echo(f"{file}:{line}: this text has the word '{old.rpartition('.')[2]}'; change it if the name is meant")


def _with_line_ends(file: Path, text: str) -> str:
    r"""Return a text with the line ends of a file; `\r\n` if the file has any."""
    return text.replace("\n", "\r\n") if b"\r\n" in file.read_bytes() else text


def _difference(file: Path, before: str, after: str) -> str:
    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    found = unified_diff(old, new, str(file), str(file))
    return "".join(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in found)
