"""Commands that list a store's past changes and follow new ones."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated

import typer

from knowledge_base.cli.inputs import Json, Store, opened_store
from knowledge_base.cli.printing import (
    change_form,
    clock_time,
    delta_lines,
    print_json,
    print_json_list,
    print_line,
    print_table,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from knowledge_base.facts import Change
    from knowledge_base.store import KnowledgeBase

Pattern = Annotated[
    str | None, typer.Argument(metavar="[PATTERN]", help="Only changes of this, e.g. '(on ?x table)' or '(weight ?x)'.")
]
TOGETHER = 1000
"""Number of changes that are read together."""
POLL_S = 0.1
"""Seconds between two looks at a store that other processes write."""


def history(
    store: Store,
    pattern: Pattern = None,
    since: Annotated[int | None, typer.Option(metavar="VERSION", help="Only later changes.")] = None,
    until: Annotated[int | None, typer.Option(metavar="VERSION", help="Only changes up to this one.")] = None,
    json: Json = False,
) -> None:
    """List each change with its time and author."""
    with opened_store(store) as kb:
        touches = _touches(kb, pattern)
        changes = filter(touches, _changes(kb, kb.oldest if since is None else since, until))
        if json:
            print_json_list(map(change_form, changes))
            return
        rows = ([c.version, clock_time(c.time), c.author, "\n".join(delta_lines(c.delta))] for c in changes)
        print_table(["version", "time", "author", "change"], rows)


def check(store: Store, json: Json = False) -> None:
    """Check that a store's knowledge is complete and unchanged; reads all of it. For runs see `dsc runs check`."""
    from knowledge_base.journal.archive import Archive

    archive = Archive(store.resolve(), None)
    last = archive.require_all()
    if json:
        print_json({"oldest": archive.oldest(), "newest": last})
        return
    typer.echo(f"versions {archive.oldest()} to {last}: as they were written")


def watch(
    store: Store,
    pattern: Pattern = None,
    count: Annotated[int | None, typer.Option(min=1, help="End after this number of changes.")] = None,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="End after this number of seconds.")] = None,
    json: Json = False,
) -> None:
    """Print changes as others commit them, until Ctrl-C."""
    with opened_store(store) as kb:
        touches, left = _touches(kb, pattern), count
        end = None if seconds is None else time.monotonic() + seconds

        def heard(change: Change) -> None:
            nonlocal left
            if left != 0 and touches(change):
                _print(change, as_json=json)
                left = None if left is None else left - 1

        kb.subscribe(heard)
        while left != 0 and (end is None or time.monotonic() < end):
            kb.refresh()
            time.sleep(POLL_S)


def _changes(kb: KnowledgeBase, since: int, until: int | None) -> Iterator[Change]:
    """Yield the changes of a store, in several reads."""
    last = kb.version if until is None else until
    kb.changes(last, last)  # report a wrong version before the first change
    yield from kb.changes(since, min(last, since + TOGETHER))
    for first in range(since + TOGETHER, last, TOGETHER):
        yield from kb.changes(first, min(last, first + TOGETHER))


def _touches(kb: KnowledgeBase, pattern: str | None) -> Callable[[Change], bool]:
    from knowledge_base.conditions.pattern import touches
    from knowledge_base.language.syntax.text import parse_condition

    return (lambda _: True) if pattern is None else touches(parse_condition(pattern, "PATTERN"), {}, kb.schema)


def _print(change: Change, *, as_json: bool) -> None:
    from knowledge_base.errors import printable

    if as_json:
        print_line(change_form(change))
        return
    typer.echo(f"version {change.version}, {clock_time(change.time)}, {change.author}")
    for line in delta_lines(change.delta):
        typer.echo(f"  {printable(line)}")
