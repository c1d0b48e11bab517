"""Commands that bring a world in, take it out, and draw it."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from knowledge_base.cli.sources import Domain, Source, Store, is_store, opened, writable


class Form(StrEnum):
    """What a world is written as."""

    JSON = "json"
    PDDL = "pddl"


To = Annotated[Path | None, typer.Option("--to", metavar="FILE", help="Write here.  [default: standard output]")]


def import_(
    store: Store,
    source: Source,
    author: Annotated[str | None, typer.Option(help="Who says so.  [default: SOURCE]")] = None,
    domain: Domain = None,
) -> None:
    """Tell a store all that another world says, as one change; what the store knows already stays."""
    from knowledge_base.facts import Delta

    with opened(source, domain) as (other, _), writable(store) as kb:
        said = Delta(nodes=other.nodes(), added=tuple(other.facts()), values=other.values())
        change = kb.apply(said, author or str(source))
        typer.echo(f"{len(change.delta)} things, facts and numbers are new; version {kb.version}")


def export(
    source: Source,
    to: To = None,
    form: Annotated[Form | None, typer.Option("--as", help="The form.  [default: by FILE's ending, else json]")] = None,
    domain: Domain = None,
) -> None:
    """Write a world as JSON (lossless, with its schema) or as the start of a PDDL problem."""
    with opened(source, domain) as (kb, problem):
        pddl = form is Form.PDDL or (form is None and to is not None and to.suffix == ".pddl")
        text = kb.to_pddl(problem.domain if problem else "world", source.stem) if pddl else kb.to_json()
    _write(text, to)


def draw(
    source: Source,
    thing: Annotated[str | None, typer.Argument(metavar="[THING]", help="Draw what is around this thing.")] = None,
    hops: Annotated[int, typer.Option(min=0, help="How many arcs away from THING.")] = 1,
    to: To = None,
    domain: Domain = None,
) -> None:
    """Draw a world's graph, or the neighbourhood of THING, as SVG."""
    from knowledge_base.drawing import draw as drawn

    with opened(source, domain) as (kb, _):
        _write(drawn(kb, thing, hops), to)


def _write(text: str, to: Path | None) -> None:
    from knowledge_base.errors import InputError

    if to is None:
        typer.echo(text)
        return
    if is_store(to):
        raise InputError(f"'{to}' is a store, with its history; nothing else is written in its place")
    try:
        to.write_text(text if text.endswith("\n") else text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write '{to}': {error.strerror}") from None
    typer.echo(f"wrote {to}")
