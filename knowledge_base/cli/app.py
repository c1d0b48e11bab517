"""The commands of `dsc kb`, put together."""

from __future__ import annotations

import typer

from knowledge_base.cli import asking, exchanging, following, telling

app = typer.Typer(
    rich_markup_mode=None,
    no_args_is_help=True,
    help="A world model: ask what holds, tell what is new, look back, watch, draw.",
)
for command in (
    telling.new,
    asking.show,
    asking.query,
    asking.ask,
    telling.tell,
    telling.retract,
    following.watch,
    following.history,
    following.check,
    asking.at,
    telling.compact,
):
    app.command()(command)
app.command("import")(exchanging.import_)
app.command()(exchanging.export)
app.command()(exchanging.draw)
