"""Commands that make a store and change it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from knowledge_base.cli.inputs import Json, Store, writable
from knowledge_base.cli.printing import change_form, delta_lines, print_json
from knowledge_base.cli.versions import moment

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from knowledge_base.facts import Delta
    from knowledge_base.language.evaluation.world import World

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
    """Make an empty store with the schema of a PDDL domain."""
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
    """Make facts true, set numbers, name things: all of it or, with a mistake, nothing."""
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
    """Retract facts, or remove things with all facts about them: all of it or, with a mistake, nothing."""
    from knowledge_base.statements import retracted

    _change(store, facts, retracted, author, expect, key, as_json=json)


def compact(
    store: Store,
    keep: Annotated[
        str | None, typer.Option(metavar="MOMENT", help="The oldest version or time to keep.  [default: now]")
    ] = None,
    json: Json = False,
) -> None:
    """Forget a store's past and make its file smaller; keys of changes are remembered."""
    with writable(store) as kb:
        before = _size(store)
        kb.compact(kb.version if keep is None else kb.at(**moment(keep)).version)
        said = {"oldest": kb.oldest, "version": kb.version, "bytes_before": before, "bytes": _size(store)}
    if json:
        print_json(said)
        return
    sizes = f"{said['bytes'] / 1000:,.0f} kB, before {before / 1000:,.0f} kB"
    typer.echo(f"versions {said['oldest']} to {said['version']} are kept: {sizes}")


def _size(store: Path) -> int:
    """Return the size in bytes, with SQLite's log."""
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
    from knowledge_base.errors import ConflictError, InputError, printable

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
