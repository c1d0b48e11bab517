"""Inputs of commands: a store, a PDDL problem, a world in JSON, or a scenario."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

if TYPE_CHECKING:
    from knowledge_base.pddl import ProblemText
    from knowledge_base.store import KnowledgeBase

Source = Annotated[
    Path, typer.Argument(metavar="SOURCE", help="A store, a PDDL problem, a world in JSON, or a scenario (YAML).")
]
Store = Annotated[Path, typer.Argument(metavar="STORE", help="A store's file.")]
Domain = Annotated[
    Path | None,
    typer.Option("--domain", metavar="D.pddl", help="A problem's domain.  [default: domain.pddl next to it]"),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]

_MARK = b"\xef\xbb\xbf"  # byte order mark, in UTF-8

readers: dict[str, Callable[[Path], KnowledgeBase]] = {}
"""Readers of further sources by file ending, e.g. `.yaml`; upper rooms register theirs."""


class Opened(NamedTuple):
    """An opened world, and the problem whose initial state it is, if any."""

    kb: KnowledgeBase
    problem: ProblemText | None = None


@contextmanager
def opened(source: Path, domain: Path | None = None) -> Iterator[Opened]:
    """Open any source for reading; other processes may write a store meanwhile.

    Raises:
        InputError: the file is missing, or of none of these kinds.
    """
    found = _opened(source, domain)
    with found.kb:
        yield found


@contextmanager
def opened_store(store: Path) -> Iterator[KnowledgeBase]:
    """Open a store for reading; other sources have no past.

    Raises:
        StoreError: the file is missing, or not a store.
    """
    from knowledge_base.store import KnowledgeBase

    with KnowledgeBase.open(None, store, read_only=True) as kb:
        yield kb


@contextmanager
def writable(store: Path) -> Iterator[KnowledgeBase]:
    """Open an existing store for writing.

    Raises:
        StoreError: the file is missing or not a store, or another writer has it open.
    """
    from knowledge_base.store import KnowledgeBase

    with KnowledgeBase.open(None, store, read_only=True):
        pass  # another kind of file gets the reader's message, and no file is made
    with KnowledgeBase.open(None, store) as kb:
        yield kb


def domain_of(problem: Path) -> Path:
    """Return the default path of a problem's domain."""
    return problem.parent / "domain.pddl"


def _opened(source: Path, domain: Path | None) -> Opened:
    from knowledge_base.exchange import MAX_WORLD_BYTES
    from knowledge_base.journal.sidecar_files import is_database
    from knowledge_base.pddl.files import MAX_BYTES, decoded, read_bytes, require_size
    from knowledge_base.store import KnowledgeBase

    if is_database(source):
        return Opened(KnowledgeBase.open(None, source, read_only=True))
    if source.suffix in readers:
        return Opened(readers[source.suffix](source))
    data = read_bytes(source, MAX_WORLD_BYTES)  # once, since a pipe can be read only once
    if data.removeprefix(_MARK).lstrip()[:1] == b"{":
        return Opened(KnowledgeBase.from_json(decoded(data, source), source=str(source)))
    require_size(len(data), MAX_BYTES, str(source))
    return _problem(decoded(data, source, errors="surrogateescape"), source, domain)


def _problem(text: str, source: Path, domain: Path | None) -> Opened:
    from knowledge_base.pddl import parse_problem
    from knowledge_base.store import KnowledgeBase
    from knowledge_base.world.schema import Schema

    schema = Schema.from_pddl(domain or _beside(source))
    problem = parse_problem(text, schema, str(source))
    kb = KnowledgeBase(schema)
    kb.apply(problem.delta(), author=str(source))
    return Opened(kb, problem)


def _beside(problem: Path) -> Path:
    from knowledge_base.errors import InputError

    domain = domain_of(problem)
    if not domain.exists():
        raise InputError(f"there is no '{domain}' next to the problem; name its domain with --domain")
    return domain
