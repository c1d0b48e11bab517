"""Check of one text in the server's process: fast, and without the project's Python code."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from threading import Lock

from dsc.dynamic.library import Library
from dsc.editing.kinds import Kind, kind_of
from dsc.editing.project_facts import ProjectFacts
from dsc.errors import Finding
from dsc.model.plot import ActionPlot
from dsc.text.incremental import IncrementalReader
from dsc.text.plot_files import Neighbours, plot_in
from dsc.text.profiles import parse_profile
from dsc.text.yaml import load_document
from dsc.validation import review_plot, validate_plot
from dsc.validation.ignored import without_ignored
from knowledge_base.errors import InputError, collecting, tolerated
from knowledge_base.language.syntax.sexpr import read
from knowledge_base.pddl.files import read_text
from knowledge_base.pddl.problem_text import parse_problem
from knowledge_base.world.schema import Schema

READABLE = "readable"
"""The code of findings about texts that cannot be read."""
MOST_PLOTS, MOST_SCHEMAS = 500, 20
"""Maximum number of versions of plots and of domains that are stored."""
_MAY_BE_UNREAD = frozenset({"known-plot", "rule-event", "known-event", "known-outcome", "every-outcome-is-wired"})
"""Codes of findings that the unreadable file of another plot may cause."""
_PROBLEM = re.compile(r"\(\s*define\s*\(\s*problem\b", re.IGNORECASE)


class QuickCheck:
    """The check of single texts, e.g. of an editor's buffers; it stores what it has read of earlier versions."""

    def __init__(self) -> None:
        self._reader = IncrementalReader()
        self._lock = Lock()
        self._plot = lru_cache(maxsize=MOST_PLOTS)(self._parse)
        self._schema = lru_cache(maxsize=MOST_SCHEMAS)(Schema.parse)

    def findings(self, file: Path, text: str, facts: ProjectFacts) -> list[Finding]:
        """Return the findings about one text. Findings about other files are not among them.

        A plot may use the other plots of its folder.

        Args:
            file: the file of the text.
            text: the text, which need not be that of the file on disk.
            facts: the facts of the project around the file; without skills, triggers are not checked.
        """
        found: list[Finding] = []
        with self._lock, collecting() as errors, tolerated():
            found = list(self._findings(file, text, facts))
        found += [Finding(error, READABLE) for error in errors]
        return [one for one in without_ignored(found, [file]) if _is_in(one.error, file)]

    def _findings(self, file: Path, text: str, facts: ProjectFacts) -> Iterator[Finding]:
        kind = kind_of(file, text)
        if kind is Kind.PLOT:
            yield from self._plot_findings(file, self._plot(text, str(file)), facts)
        elif kind is Kind.PROFILE:
            parse_profile(text, str(file))
        elif kind is Kind.SCENARIO:
            load_document(text, str(file))
        elif kind is Kind.PDDL:
            self._read_pddl(file, text)

    def _parse(self, text: str, source: str) -> ActionPlot:
        return plot_in(self._reader.load(text, source)[0])

    def _plot_findings(self, file: Path, plot: ActionPlot, facts: ProjectFacts) -> list[Finding]:
        library, broken = Neighbours(self._plot).of(file, plot)
        self._add_missing(library, facts)
        schema = facts.schema or self._schema_near(file)
        objects = facts.objects if facts.schema is not None else None
        findings = validate_plot(plot, library, schema, facts.skills, objects=objects, thorough=True)
        findings = findings or review_plot(plot, library, facts.skills)
        return [one for one in findings if not (broken and one.code in _MAY_BE_UNREAD)]

    def _add_missing(self, library: Library, facts: ProjectFacts) -> None:
        """Add the plots of other bundles, which are in other folders."""
        waiting: list[ActionPlot] = [*library]
        while waiting:
            for name in waiting.pop().uses():
                file = facts.plots.get(name)
                if file and name not in library:
                    with collecting(), tolerated():
                        other = self._plot(read_text(Path(file)), file)
                        library.add(other)
                        waiting.append(other)

    def _schema_near(self, file: Path) -> Schema | None:
        """Return the schema of `domain.pddl` in a file's folder or the folder above; `None` without a readable one."""
        for folder in (file.parent, file.parent.parent):
            domain = folder / "domain.pddl"
            if domain.is_file():
                with collecting(), tolerated():
                    return self._schema(read_text(domain), str(domain))
                return None
        return None

    def _read_pddl(self, file: Path, text: str) -> None:
        """Raise `InputError` for a domain or problem with a mistake, or for text that is not PDDL."""
        if _PROBLEM.search(text) is None:
            self._schema(text, str(file))
            return
        schema = self._schema_near(file)
        if schema is None:
            read(text, str(file))
        else:
            parse_problem(text, schema, str(file))


def _is_in(error: InputError, file: Path) -> bool:
    return error.place is None or error.place.source in {None, str(file)}
