"""`dsc kb`: a world model on the command line; commands import their modules only when they run, to start quickly."""

from __future__ import annotations

import typer

from knowledge_base.cli import changes, queries
from knowledge_base.cli.console import register_reader as register_reader
from knowledge_base.cli.console import register_relations as register_relations

app = typer.Typer(
    rich_markup_mode=None,
    no_args_is_help=True,
    help="A world model: query it, change it, inspect its past, watch it, draw it.",
)
for command in (
    changes.new,
    queries.show,
    queries.query,
    queries.ask,
    changes.tell,
    changes.retract,
    queries.watch,
    queries.history,
    queries.check,
    queries.at,
    changes.compact,
):
    app.command()(command)
app.command("import")(changes.import_)
app.command()(changes.export)
app.command()(changes.draw)
