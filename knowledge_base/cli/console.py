"""Arguments, sources of worlds, and output of the commands: tables for people, JSON for programs."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from itertools import islice, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypedDict

import typer

from knowledge_base.errors import InputError, printable
from knowledge_base.spelling import value_text

if TYPE_CHECKING:
    from knowledge_base.facts import Change, Delta
    from knowledge_base.pddl import ProblemText
    from knowledge_base.store import KnowledgeBase
    from knowledge_base.world.live_rows import Rows

Source = Annotated[
    Path, typer.Argument(metavar="SOURCE", help="A store, a PDDL problem, a world in JSON, or a scenario (YAML).")
]
Store = Annotated[Path, typer.Argument(metavar="STORE", help="A store's file.")]
Domain = Annotated[
    Path | None,
    typer.Option("--domain", metavar="D.pddl", help="A problem's domain.  [default: domain.pddl next to it]"),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


MOST_ROWS = 5000
"""Maximum number of rows in one table.

A column is as wide as its widest cell, so that all rows of a table must be in memory before the first is printed.
"""
_MARK = b"\xef\xbb\xbf"  # byte order mark, in UTF-8
_MOST_DIGITS = 15
"""Maximum number of digits of a version: more than any store needs, and few enough to parse quickly."""

_readers: list[Callable[[Path], KnowledgeBase | None]] = []
_providers: list[Callable[[Path], Mapping[str, Rows]]] = []


def register_reader(reader: Callable[[Path], KnowledgeBase | None]) -> None:
    """Let commands read further sources by `reader`, which returns `None` for a source of another kind."""
    _readers.append(reader)


def register_relations(provider: Callable[[Path], Mapping[str, Rows]]) -> None:
    """Let queries of a store read relations, whose rows `provider` returns."""
    _providers.append(provider)


class Opened(NamedTuple):
    """An opened world, and the problem if the world is its initial state."""

    kb: KnowledgeBase
    problem: ProblemText | None = None


@contextmanager
def opened(source: Path, domain: Path | None = None) -> Iterator[Opened]:
    """Open any source for reading; other processes may write a store at the same time.

    Raises:
        InputError: the file is missing, or is not a store, problem, world or scenario.
    """
    found = _open(source, domain)
    with found.kb:
        yield found


def opened_store(store: Path) -> KnowledgeBase:
    """Open a store for reading; other kinds of sources are refused, since only a store has a history.

    Raises:
        StoreError: the file is missing, or is not a store.
    """
    from knowledge_base.store import KnowledgeBase

    return KnowledgeBase.open(None, store, read_only=True)


def writable(store: Path) -> KnowledgeBase:
    """Open an existing store for writing.

    Raises:
        StoreError: the file is missing or not a store, or another writer has it open.
    """
    from knowledge_base.store import KnowledgeBase

    opened_store(store).close()  # report other kinds of files, and create no file
    return KnowledgeBase.open(None, store)


def domain_of(problem: Path) -> Path:
    """Return the default path of a problem's domain."""
    return problem.parent / "domain.pddl"


def _open(source: Path, domain: Path | None) -> Opened:
    from knowledge_base.exchange import MAX_WORLD_BYTES
    from knowledge_base.journal.sidecar_files import is_database
    from knowledge_base.pddl.files import MAX_BYTES, decoded, read_bytes, require_size
    from knowledge_base.store import KnowledgeBase

    if is_database(source):
        kb = KnowledgeBase.open(None, source, read_only=True)
        for provider in _providers:
            kb.provide(provider(source))
        return Opened(kb)
    for reader in _readers:
        if (world := reader(source)) is not None:
            return Opened(world)
    data = read_bytes(source, MAX_WORLD_BYTES)  # read only once, as a pipe allows
    if data.removeprefix(_MARK).lstrip()[:1] == b"{":
        return Opened(KnowledgeBase.from_json(decoded(data, source), source=str(source)))
    require_size(len(data), MAX_BYTES, str(source))
    return _problem(decoded(data, source, errors="surrogateescape"), source, domain)


def _problem(text: str, source: Path, domain: Path | None) -> Opened:
    from knowledge_base.pddl import parse_problem
    from knowledge_base.store import KnowledgeBase
    from knowledge_base.world.schema import Schema

    domain = domain or domain_of(source)
    if domain == domain_of(source) and not domain.exists():
        raise InputError(f"there is no '{domain}' next to the problem; name its domain with --domain")
    problem = parse_problem(text, schema := Schema.from_pddl(domain), str(source))
    kb = KnowledgeBase(schema)
    kb.apply(problem.delta(), author=str(source))
    return Opened(kb, problem)


class Moment(TypedDict, total=False):
    """The arguments of `KnowledgeBase.at`: either a version or a time in seconds."""

    version: int
    time: float


def moment(text: str) -> Moment:
    """Return the arguments of `KnowledgeBase.at` for a version (`12`) or a time (ISO 8601; local without a time zone).

    Raises:
        InputError: the text is neither a version nor a time.
    """
    if text.isdecimal() and len(text) <= _MOST_DIGITS:
        return {"version": int(text)}
    try:
        return {"time": datetime.fromisoformat(text).timestamp()}
    except (ValueError, OverflowError, OSError):
        raise InputError(f"a moment is a version such as 12 or a time such as 2026-11-21T16:40, not '{text}'") from None


def print_json(said: Any) -> None:
    """Print one JSON value."""
    typer.echo(json.dumps(said, indent=2))


def print_json_list(items: Iterable[Any], said: Mapping[str, Any] | None = None, name: str = "") -> None:
    """Print the list, or `{**said, name: [*items]}`, as `print_json` does, but write each item immediately."""
    whole: object = [] if said is None else {**said, name: []}
    head, _, tail = json.dumps(whole, indent=2).rpartition("[]")
    indent = "\n" + "  " * (1 if said is None else 2)
    write, before, end = sys.stdout.write, indent, "]"
    write(head + "[")
    for item in items:
        write(before + json.dumps(item, indent=2).replace("\n", indent))
        before, end = "," + indent, indent[:-2] + "]"
    write(f"{end}{tail}\n")


def print_line(said: Any) -> None:
    """Print one JSON value on one line and flush the output, for programs that follow it."""
    typer.echo(json.dumps(said))
    sys.stdout.flush()


def print_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print tables at most as wide as the terminal, each with at most `MOST_ROWS` rows."""
    rest = iter(rows)
    _print_table(head, islice(rest, MOST_ROWS))
    while some := list(islice(rest, MOST_ROWS)):
        _print_table(head, some)


def _print_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print one table; if the table is too wide, Rich wraps its cells, which is slow for many rows."""
    from rich.box import HEAVY_HEAD
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    cells = [[[*map(printable, str(cell).split("\n"))] for cell in row] for row in ([*head], *rows)]
    widths = [max(cell_len(line) for cell in column for line in cell) for column in zip(*cells, strict=True)]
    if sum(widths) + 3 * len(widths) + 1 > console.width:
        table = Table()
        for title in head:
            table.add_column(Text(title))
        for row in cells[1:]:
            table.add_row(*(Text("\n".join(cell)) for cell in row))
        console.print(table)
        return
    box, outer = HEAVY_HEAD.substitute(console.options), [width + 2 for width in widths]
    lines = [box.get_top(outer)]
    for number, row in enumerate(cells):
        left, middle, right = (
            (box.head_left, box.head_vertical, box.head_right)
            if number == 0
            else (box.mid_left, box.mid_vertical, box.mid_right)
        )
        for line in zip_longest(*row, fillvalue=""):
            texts = [f" {text}{' ' * (width - cell_len(text))} " for text, width in zip(line, widths, strict=True)]
            lines.append(left + middle.join(texts) + right)
        if number == 0:
            lines.append(box.get_row(outer, "head"))
    typer.echo("\n".join((*lines, box.get_bottom(outer))))


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
    except (OverflowError, ValueError, OSError):  # the time of another clock, e.g. simulated time in the far future
        return f"{seconds:g} s"
