"""Output of commands: tables for people, JSON for programs, changes and explanations as lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import islice
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from knowledge_base.facts import Change, Delta
    from knowledge_base.language.evaluation.explanation import Explanation

MOST_ROWS = 5000
"""Rows of one table. Columns are as wide as their widest cell, so that all rows must exist before the first is
printed.
"""


def print_json(said: Any) -> None:
    """Print one JSON value."""
    import json

    typer.echo(json.dumps(said, indent=2))


def print_json_list(items: Iterable[Any], said: Mapping[str, Any] | None = None, name: str = "") -> None:
    """Print the list, or `{**said, name: [*items]}`, as `print_json` does, but each item as it arrives."""
    import json
    import sys

    whole: object = [] if said is None else {**said, name: []}
    head, _, tail = json.dumps(whole, indent=2).rpartition("[]")
    indent = "\n" + "  " * (1 if said is None else 2)
    write, before, end = sys.stdout.write, indent, "]"
    write(head + "[")
    for item in items:
        write(before + json.dumps(item, indent=2).replace("\n", indent))
        before, end = "," + indent, indent[:-2] + "]"
    write(f"{end}{tail}\n")


def print_line(said: Mapping[str, Any]) -> None:
    """Print one JSON object on a line and flush, for programs that follow the output."""
    import json
    import sys

    typer.echo(json.dumps(said))
    sys.stdout.flush()


def print_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table up to the width of the terminal or output; after `MOST_ROWS` rows another one begins."""
    rest = iter(rows)
    _print_table(head, islice(rest, MOST_ROWS))
    while some := list(islice(rest, MOST_ROWS)):
        _print_table(head, some)


def _print_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from knowledge_base.errors import printable

    table = Table()
    for title in head:
        table.add_column(Text(title))
    for row in rows:
        table.add_row(*(Text("\n".join(map(printable, str(cell).split("\n")))) for cell in row))
    Console().print(table)


def change_form(change: Change) -> dict[str, Any]:
    """Return a change as JSON data: version, time in seconds, author, and the content as text."""
    return {"version": change.version, "time": change.time, "author": change.author, **delta_form(change.delta)}


def delta_form(delta: Delta) -> dict[str, Any]:
    """Return the content of a change as JSON data, with facts in PDDL."""
    return {
        "objects": dict(delta.nodes),
        "removed_objects": list(delta.removed_nodes),
        "added": [str(fact) for fact in delta.added],
        "removed": [str(fact) for fact in delta.removed],
        "values": {str(fluent): content for fluent, content in delta.values.items()},
    }


def delta_lines(delta: Delta) -> Iterator[str]:
    """Yield the content of a change as lines, each after a sign: `+ (on cup1 table)`."""
    from knowledge_base.spelling import value_text

    yield from (f"- {value_text(name)} and all about it" for name in delta.removed_nodes)
    yield from (f"+ ({type_name} {value_text(name)})" for name, type_name in delta.nodes.items())
    yield from (f"- {fact}" for fact in delta.removed)
    yield from (f"+ {fact}" for fact in delta.added)
    for fluent, content in delta.values.items():
        yield f"= {fluent} {value_text(content, quoted=isinstance(content, str))}"


def clock_time(seconds: float) -> str:
    """Return seconds since 1970 as ISO 8601: `2026-11-21T16:40:03.250Z`."""
    try:
        return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    except (OverflowError, ValueError, OSError):  # another clock, e.g. simulated time far ahead
        return f"{seconds:g} s"


def explanation_lines(why: Explanation, depth: int = 0, *, deciding: bool = True) -> Iterator[str]:
    """Yield the tree of a condition, a line for each part; arrows lead to the deciding one."""
    indent = "" if depth == 0 else "   " * (depth - 1) + ("-> " if deciding else "   ")
    detail = f"   [{why.detail}]" if why.detail else ""
    yield f"{indent}{'true ' if why.truth else 'false'}  {why.text}{detail}"
    for number, child in enumerate(why.children):
        yield from explanation_lines(child, depth + 1, deciding=deciding and number == why.decider)
