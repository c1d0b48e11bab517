"""What a command is asked to look into or to change: a store, a problem, a world in JSON, a scenario."""

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
    typer.Option("--domain", metavar="D.pddl", help="A problem's domain.  [default: domain.pddl beside it]"),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]

_MARK = b"\xef\xbb\xbf"  # of byte order, in UTF-8

readers: dict[str, Callable[[Path], KnowledgeBase]] = {}
"""More kinds of sources by the ending of their file, e.g. `.yaml`; upper rooms add theirs."""


class Opened(NamedTuple):
    """A world that was opened, and the problem that it is the start of, if it is one."""

    kb: KnowledgeBase
    problem: ProblemText | None = None


@contextmanager
def opened(source: Path, domain: Path | None = None) -> Iterator[Opened]:
    """Any source, to be looked into; a store may be written by others meanwhile.

    Raises:
        InputError: there is no such file, or it is none of these.
    """
    found = _opened(source, domain)
    with found.kb:
        yield found


@contextmanager
def opened_store(store: Path) -> Iterator[KnowledgeBase]:
    """A store, and nothing else, to be looked into: only a store has a past.

    Raises:
        StoreError: it is not there, or is no store.
    """
    from knowledge_base.store import KnowledgeBase

    with KnowledgeBase.open(None, store, read_only=True) as kb:
        yield kb


@contextmanager
def writable(store: Path) -> Iterator[KnowledgeBase]:
    """A store that is there, to be changed.

    Raises:
        StoreError: it is not there, is no store, or somebody else is writing it.
    """
    from knowledge_base.store import KnowledgeBase

    with KnowledgeBase.open(None, store, read_only=True):
        pass  # what is no store gets the message of a reader, and no file is made
    with KnowledgeBase.open(None, store) as kb:
        yield kb


def domain_of(problem: Path) -> Path:
    """Where a problem's domain is, if nobody names it."""
    return problem.parent / "domain.pddl"


def _opened(source: Path, domain: Path | None) -> Opened:
    from knowledge_base.exchange.world_json import MAX_WORLD_BYTES
    from knowledge_base.journal.sidecar_files import is_database
    from knowledge_base.pddl.files import MAX_BYTES, decoded, read_bytes, require_size
    from knowledge_base.store import KnowledgeBase

    if is_database(source):
        return Opened(KnowledgeBase.open(None, source, read_only=True))
    if source.suffix in readers:
        return Opened(readers[source.suffix](source))
    data = read_bytes(source, MAX_WORLD_BYTES)  # once: a pipe gives nothing a second time
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
        raise InputError(f"there is no '{domain}' beside the problem; name its domain with --domain")
    return domain
