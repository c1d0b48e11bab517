"""Commands that create and change a store, and that import, export and draw a world."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from knowledge_base.cli.console import (
    Domain,
    Json,
    Source,
    Store,
    change_form,
    delta_lines,
    domain_of,
    moment,
    opened,
    print_json,
    writable,
)
from knowledge_base.errors import ConflictError, InputError, printable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from knowledge_base.facts import Delta
    from knowledge_base.language.evaluation.world_protocol import World
    from knowledge_base.output_files import Output


class ExchangeFormat(StrEnum):
    """The format of an exported world."""

    JSON = "json"
    PDDL = "pddl"


To = Annotated[Path, typer.Option("--to", metavar="FILE", help="Write here; - is standard output.")]
STANDARD_OUTPUT = Path("-")
Facts = Annotated[
    list[str],
    typer.Argument(metavar="FACT...", help="'(on cup1 table)', '(cup cup1)', '(= (weight cup1) 0.2)', any effect."),
]
Gone = Annotated[
    list[str], typer.Argument(metavar="FACT...", help="'(on cup1 table)'; '(cup cup1)' removes the thing.")
]
Author = Annotated[str, typer.Option(help="The author of the change, kept in the history.")]
Expect = Annotated[
    int | None, typer.Option(metavar="VERSION", help="Change nothing unless this is the store's version.")
]
Key = Annotated[str | None, typer.Option(help="A name for this change: the same key again changes nothing.")]


def new(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The file to make.")],
    domain: Annotated[Path, typer.Option("--domain", metavar="D.pddl", help="The schema: a PDDL domain.")],
    functional: Annotated[
        list[str] | None,
        typer.Option(metavar="PREDICATE", help="Only one of its facts that differ in the last argument alone is true."),
    ] = None,
) -> None:
    """Create an empty store with the schema of a PDDL domain."""
    from knowledge_base.store import KnowledgeBase
    from knowledge_base.world.schema import Schema

    schema = Schema.from_pddl(domain).with_functional(*functional or ())
    with KnowledgeBase.open(schema, store, new=True) as kb:
        said = f"{len(schema.types)} types, {len(schema.predicates)} predicates, {len(schema.functions)} functions"
        typer.echo(f"made {store}: {said}, {len(kb.nodes())} constants")


def tell(
    store: Store,
    facts: Facts,
    author: Author = "dsc kb",
    expect: Expect = None,
    key: Key = None,
    json: Json = False,
) -> None:
    """Make facts true, set values and add objects; a mistake in any FACT changes nothing."""
    from knowledge_base.statements import told

    _change(store, facts, told, author, expect, key, as_json=json)


def retract(
    store: Store,
    facts: Gone,
    author: Author = "dsc kb",
    expect: Expect = None,
    key: Key = None,
    json: Json = False,
) -> None:
    """Retract facts, or remove objects with all their facts; a mistake in any FACT changes nothing."""
    from knowledge_base.statements import retracted

    _change(store, facts, retracted, author, expect, key, as_json=json)


def compact(
    store: Store,
    keep: Annotated[
        str | None, typer.Option(metavar="MOMENT", help="The oldest version or time to keep.  [default: now]")
    ] = None,
    json: Json = False,
) -> None:
    """Remove past versions of a store to make its file smaller; the keys of changes stay."""
    with writable(store) as kb:
        before = _size(store)
        kb.compact(kb.version if keep is None else kb.at(**moment(keep)).version)
        said = {"oldest": kb.oldest, "version": kb.version, "bytes_before": before, "bytes": _size(store)}
    if json:
        print_json(said)
        return
    sizes = f"{said['bytes'] / 1000:,.0f} kB, before {before / 1000:,.0f} kB"
    typer.echo(f"versions {said['oldest']} to {said['version']} are kept: {sizes}")


def import_(
    store: Store,
    source: Source,
    author: Annotated[str | None, typer.Option(help="The author of the change.  [default: SOURCE]")] = None,
    domain: Domain = None,
) -> None:
    """Add the content of another world to a store, as one change; the store's own content stays."""
    with opened(source, domain) as (other, _), writable(store) as kb:
        change = kb.apply(other.contents(), author or str(source))
        typer.echo(f"{len(change.delta)} things, facts and numbers are new; version {kb.version}")


def export(
    source: Source,
    to: To = STANDARD_OUTPUT,
    form: Annotated[
        ExchangeFormat | None, typer.Option("--as", help="The format.  [default: by FILE's ending, else json]")
    ] = None,
    domain: Domain = None,
) -> None:
    """Write a world as JSON (without loss, with its schema) or as the initial state of a PDDL problem."""
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


def _size(store: Path) -> int:
    """Return the size of the store in bytes, including SQLite's log."""
    log = store.with_name(store.name + "-wal")
    return store.stat().st_size + (log.stat().st_size if log.exists() else 0)


def _change(
    store: Path,
    statements: list[str],
    meaning: Callable[[Iterable[str], World, str], Delta],
    author: str,
    expect: int | None,
    key: str | None,
    *,
    as_json: bool,
) -> None:
    with writable(store) as kb:
        before = kb.version
        try:
            change = kb.apply(meaning(statements, kb, "FACT"), author, expect=expect, key=key)
        except ConflictError as error:
            raise InputError(str(error)) from None
        again = key is not None and kb.version == before and bool(change.delta)
    if as_json:
        print_json({**change_form(change), "again": again})
        return
    if again:
        typer.echo(f"the key '{key}' was used already, for version {change.version}: nothing new")
        return
    for line in map(printable, delta_lines(change.delta)):
        typer.echo(line)
    if not change.delta:
        typer.echo("nothing new")
    typer.echo(f"version {change.version}")


def _output(to: Path, source: Path, domain: Path | None) -> Output:
    """Return the output; raise `InputError` if it is also the input."""
    from knowledge_base.output_files import Output

    return Output(to, "--to", source, domain or domain_of(source))


def _write(output: Output, text: str) -> None:
    output.write(text if text.endswith("\n") else text + "\n")
    if output.path != STANDARD_OUTPUT:
        typer.echo(f"wrote {output.path}")
