"""The app of `dsc kb` with its commands."""

from __future__ import annotations

import typer

from knowledge_base.cli import changes, exchange, follow, queries

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
    follow.watch,
    follow.history,
    follow.check,
    queries.at,
    changes.compact,
):
    app.command()(command)
app.command("import")(exchange.import_)
app.command()(exchange.export)
app.command()(exchange.draw)
