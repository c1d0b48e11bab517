"""Command `dsc tree`: check and show behaviour trees of BehaviorTree.CPP and Groot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dsc.cli.findings import JSON, SARIF, SELECT, STRICT, report
from knowledge_base.cli.console import Json, print_json
from knowledge_base.spelling import number_text

app = typer.Typer(
    name="tree",
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Behaviour trees as XML of BehaviorTree.CPP and Groot.",
)

_WRONG = 2
"""Exit status with findings."""


@app.command()
def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Behaviour trees (XML).")],
    json: JSON = False,
    sarif: SARIF = False,
    select: SELECT = None,
    strict: STRICT = False,
) -> None:
    """Report the mistakes of behaviour trees, and elements without a counterpart, one finding per line.

    Exit status: 0 without findings, or with warnings only; 2 with findings.
    """
    from dsc.trees.findings import check_trees

    every = [(file, finding) for file in files for finding in check_trees(file)]
    nothing = f"{number_text(len(files), 'file')} checked, no mistakes found"
    wrong = report(every, nothing, json=json, sarif=sarif, selection=select, strict=strict)
    raise typer.Exit(_WRONG if wrong else 0)


@app.command()
def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Behaviour trees (XML).")],
    tree: Annotated[str | None, typer.Option("--tree", metavar="NAME", help="Only this tree.")] = None,
    xml: Annotated[bool, typer.Option("--xml", help="Print the file in format 4.")] = False,
    json: Json = False,
) -> None:
    """Show the trees of a file: as text, as JSON, or as XML in format 4."""
    from dsc.trees import load_trees, trees_to_xml
    from dsc.trees.main_tree import main_tree
    from dsc.trees.picture import tree_data, tree_lines

    content = load_trees(file)
    trees = list(content.trees.values()) if tree is None else [content.trees[main_tree(content, tree)]]
    if xml:
        typer.echo(trees_to_xml(content), nl=False)
    elif json:
        print_json([tree_data(one) for one in trees])
    else:
        for one in trees:
            for line in tree_lines(one):
                typer.echo(line)
