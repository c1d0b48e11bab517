"""An index of the names in the texts of a project, in which the definitions of all texts decide the scopes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from dsc.editing.names import ANY_STEP, NameKind, Occurrence
from dsc.editing.workspace import Page


class NameIndex:
    """The names in the pages of a project.

    Args:
        pages: the pages; a half-written one has no names here.
    """

    def __init__(self, pages: Iterable[Page]) -> None:
        fresh = [page for page in pages if page.fresh]
        self._defined = {one.identity for page in fresh for one in page.names if one.defines}
        self._steps = [page.plot for page in fresh if page.plot and page.data.get("implements")]
        self._same: dict[tuple[NameKind, str, str], list[tuple[Page, Occurrence]]] = defaultdict(list)
        self._at: dict[tuple[Path, int], list[Occurrence]] = defaultdict(list)
        self._on: dict[Path, list[Occurrence]] = defaultdict(list)
        for page in fresh:
            for name in page.names:
                for one in self._resolve(name):
                    self._same[one.identity].append((page, one))
                    self._at[page.file, one.begin].append(one)
                    self._on[page.file].append(one)

    def around(self, file: Path, offset: int) -> list[Occurrence]:
        """Return the names at an offset of a file, definitions first."""
        found = [one for one in self._on[file] if one.begin <= offset <= one.end]
        return sorted(found, key=lambda one: not one.defines)

    def definitions(self, kind: NameKind) -> Iterator[Occurrence]:
        """Yield the definitions of all names of a kind."""
        for places in self._same.values():
            yield from (one for _, one in places if one.kind == kind and one.defines)

    def places(self, names: Iterable[Occurrence]) -> list[tuple[Page, Occurrence]]:
        """Return the places of names, and of all names that have a place in common with them."""
        waiting, met = [one.identity for one in names], set[tuple[NameKind, str, str]]()
        found: list[tuple[Page, Occurrence]] = []
        while waiting:
            identity = waiting.pop()
            if identity not in met:
                met.add(identity)
                found += self._same[identity]
                waiting += [
                    other.identity for page, one in self._same[identity] for other in self._at[page.file, one.begin]
                ]
        return found

    def has(self, kind: NameKind, name: str, scope: str) -> bool:
        """Return whether a text has a name, defined or not, in a scope."""
        return Occurrence(kind, name, 0, 0, scope=scope).identity in self._same

    def _resolve(self, name: Occurrence) -> Iterator[Occurrence]:
        """Yield a name once for each of its possible scopes that defines it, else with its last one."""
        if not name.scopes:
            yield name
            return
        scopes = dict.fromkeys(scope for one in name.scopes for scope in (self._steps if one == ANY_STEP else (one,)))
        found = [one for scope in scopes if (one := replace(name, scope=scope, scopes=())).identity in self._defined]
        yield from found or [replace(name, scope=name.scopes[-1], scopes=())]


class LatestIndex:
    """The index of the latest pages; it is made again only for other pages."""

    def __init__(self) -> None:
        self._latest: tuple[Sequence[Page], NameIndex] | None = None

    def of(self, pages: Sequence[Page]) -> NameIndex:
        """Return the index of pages."""
        known = self._latest
        if known is None or [*map(id, known[0])] != [*map(id, pages)]:
            known = self._latest = pages, NameIndex(pages)
        return known[1]
