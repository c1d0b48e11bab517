"""The material of an answer to an editor: a page, the project around, and the facts of its robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from dsc.editing.name_index import LatestIndex, NameIndex
from dsc.editing.names import Occurrence
from dsc.editing.project_facts import ProjectFacts
from dsc.editing.workspace import Page


@dataclass(frozen=True)
class View:
    """The material of an answer: the page of the cursor, the pages of its project, and the facts of its robot."""

    page: Page
    pages: tuple[Page, ...]
    facts: ProjectFacts
    root: Path
    latest: LatestIndex = field(default_factory=LatestIndex)

    @property
    def index(self) -> NameIndex:
        """The names of all pages."""
        return self.latest.of(self.pages)

    def names(self) -> Iterator[tuple[Page, Occurrence]]:
        """Yield all names of the project with their pages."""
        return ((page, one) for page in self.pages for one in page.names)

    def definitions(self, kind: str, scope: str | None = None) -> dict[str, str]:
        """Return the defined names of a kind with a line about each; of one scope, or of all."""
        return {
            one.name: one.about
            for _, one in self.names()
            if one.kind == kind and one.defines and (scope is None or one.scope == scope)
        }
