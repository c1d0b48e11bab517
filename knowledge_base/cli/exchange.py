"""Commands that import, export and draw a world."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from knowledge_base.cli.inputs import Domain, Source, Store, domain_of, opened, writable

if TYPE_CHECKING:
    from knowledge_base.output_files import Output


class ExchangeFormat(StrEnum):
    """The format of an exported world."""

    JSON = "json"
    PDDL = "pddl"


To = Annotated[Path, typer.Option("--to", metavar="FILE", help="Write here; - is standard output.")]
STANDARD_OUTPUT = Path("-")


def import_(
    store: Store,
    source: Source,
    author: Annotated[str | None, typer.Option(help="The author of the change.  [default: SOURCE]")] = None,
    domain: Domain = None,
) -> None:
    """Add the content of another world to a store, as one change; the store's own content stays."""
    from knowledge_base.facts import Delta

    with opened(source, domain) as (other, _), writable(store) as kb:
        said = Delta(nodes=other.nodes(), added=tuple(other.facts()), values=other.values())
        change = kb.apply(said, author or str(source))
        typer.echo(f"{len(change.delta)} things, facts and numbers are new; version {kb.version}")


def export(
    source: Source,
    to: To = STANDARD_OUTPUT,
    form: Annotated[
        ExchangeFormat | None, typer.Option("--as", help="The format.  [default: by FILE's ending, else json]")
    ] = None,
    domain: Domain = None,
) -> None:
    """Write a world as JSON (lossless, with its schema) or as the start of a PDDL problem."""
    from knowledge_base.spelling import nearest_name

    output = _output(to, source, domain)
    with opened(source, domain) as (kb, problem):
        pddl = form is ExchangeFormat.PDDL or (form is None and to.suffix == ".pddl")
        name = nearest_name(source.stem) or "world"
        text = kb.to_pddl(problem.domain if problem else "world", name) if pddl else kb.to_json()
    _write(output, text)


def draw(
    source: Source,
    thing: Annotated[
        str | None, typer.Argument(metavar="[THING]", help="Draw the neighbourhood of this thing.")
    ] = None,
    hops: Annotated[int, typer.Option(min=0, help="Maximum distance from THING, in arcs.")] = 1,
    to: To = STANDARD_OUTPUT,
    domain: Domain = None,
) -> None:
    """Draw a world's graph, or the neighbourhood of THING, as SVG."""
    from knowledge_base.drawing import draw as drawn

    output = _output(to, source, domain)
    with opened(source, domain) as (kb, _):
        text = drawn(kb, thing, hops)
    _write(output, text)


def _output(to: Path, source: Path, domain: Path | None) -> Output:
    """Return the output, which must not be the input."""
    from knowledge_base.output_files import Output

    return Output(to, "--to", source, domain or domain_of(source))


def _write(output: Output, text: str) -> None:
    output.write(text if text.endswith("\n") else text + "\n")
    if output.path != STANDARD_OUTPUT:
        typer.echo(f"wrote {output.path}")
