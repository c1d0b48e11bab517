"""The texts of a project, open or on disk, with the names in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsc.editing.disk import Disk
from dsc.editing.kinds import Kind, kind_of
from dsc.editing.names import Occurrence, plot_names, profile_names, scenario_names
from dsc.editing.pddl_names import pddl_names
from dsc.text.incremental import IncrementalReader
from dsc.text.yaml import Spans
from knowledge_base.errors import InputError
from knowledge_base.pddl.unsaved_texts import readable_text

_ENDINGS = frozenset({".yaml", ".yml", ".pddl"})


@dataclass(frozen=True, slots=True)
class Page:
    """A text with its names.

    Attributes:
        file: the file of the text.
        text: the text, of an editor or from disk.
        kind: the kind of the file.
        names: the names in the text; of half-written YAML, those of its last version without a mistake.
        data: the content of YAML, of the same version as the names.
        spans: the spans of the content of YAML.
        fresh: whether the names are of this text.
    """

    file: Path
    text: str
    kind: Kind
    names: tuple[Occurrence, ...]
    data: Any
    spans: Spans
    fresh: bool

    @property
    def plot(self) -> str:
        """The name of the plot in the text; empty for other files."""
        return str(self.data.get("plot", "")) if isinstance(self.data, dict) else ""


class Workspace:
    """The pages of projects; each text is read once."""

    def __init__(self) -> None:
        self._reader = IncrementalReader()
        self._disk = Disk()
        self._pages: dict[Path, Page] = {}

    def page(self, file: Path, text: str) -> Page:
        """Return the page of a file with this text."""
        known = self._pages.get(file)
        if known is None or known.text != text:
            known = self._pages[file] = self._read(file, text, known)
        return known

    def pages(self, root: Path, texts: Mapping[Path, str]) -> list[Page]:
        """Return the pages of all YAML and PDDL files in a folder.

        Args:
            root: the folder.
            texts: the texts of open files, in place of those on disk.
        """
        opened = {file for file in texts if file.suffix in _ENDINGS and root in file.parents}
        files = sorted(opened.union(self._disk.files_in(root, _ENDINGS)))
        return [self.page(file, texts[file] if file in texts else self._disk.text(file)) for file in files]

    def _read(self, file: Path, text: str, before: Page | None) -> Page:
        kind = kind_of(file, text)
        if kind is Kind.PDDL:
            return Page(file, text, kind, tuple(pddl_names(text)), None, Spans(), fresh=True)
        try:
            document, spans = self._reader.load(text, str(file))
        except InputError:
            names: tuple[Occurrence, ...] = ()
            data, old = None, Spans()
            if before is not None:
                names, data, old = before.names, before.data, before.spans
            return Page(file, text, kind, names, data, old, fresh=False)
        names = tuple(plot_names(document, spans, text) if kind is Kind.PLOT else ())
        names = tuple(profile_names(document.data, spans)) if kind is Kind.PROFILE else names
        names = tuple(scenario_names(document.data, spans, text)) if kind is Kind.SCENARIO else names
        return Page(file, text, kind, names, document.data, spans, fresh=True)


def text_of(file: Path, texts: Mapping[Path, str]) -> str:
    """Return the text of an open file, else the text on disk; nothing if it is not readable."""
    return texts[file] if file in texts else readable_text(file)
