"""Renames of names in all texts of a project, for editors and commands; Python code is left to its author."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from dsc.annotations import type_class
from dsc.data_types import WORDS
from dsc.editing.kinds import Kind
from dsc.editing.leftovers import lines_in_python, lines_in_texts
from dsc.editing.name_index import NameIndex
from dsc.editing.names import NameKind, Occurrence
from dsc.editing.surgery.text_edits import TextEdit, patch
from dsc.editing.view import View
from dsc.editing.workspace import Page, Workspace
from dsc.events import RESERVED
from dsc.text.plot_files import parse_plot
from knowledge_base.errors import InputError
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.language.syntax.expression import KEYWORDS

KINDS: Mapping[str, NameKind] = {
    "plot": "plot", "candidate": "plot", "state": "state", "parameter": "variable", "variable": "variable",
    "outcome": "event", "event": "event", "offer": "offer", "predicate": "relation", "function": "relation",
    "type": "type", "object": "object", "action": "action",
}  # fmt: skip
"""The kinds of names that a rename changes, by their words."""
_NAME = re.compile(r"[A-Za-z_][\w\-]*")
_TAKEN: Mapping[NameKind, frozenset[str]] = {
    "event": RESERVED, "relation": frozenset(KEYWORDS), "type": frozenset((*WORDS, ROOT_TYPE)),
}  # fmt: skip
_CLASSES = frozenset({"event", "type"})
"""Kinds of names that classes of Python have, too."""


@dataclass(frozen=True, slots=True)
class Rename:
    """The edits of a rename by file, and the places that are left to the author.

    Attributes:
        edits: the edits by file.
        in_python: file and line of each place in Python code.
        in_texts: file and line of each word in a text, e.g. of a scenario, that may or may not be the name.
    """

    edits: Mapping[Path, tuple[TextEdit, ...]]
    in_python: tuple[tuple[Path, int], ...]
    in_texts: tuple[tuple[Path, int], ...]


def rename_at(view: View, offset: int, new: str) -> Rename:
    """Return the edits that rename the name at an offset in all texts of the project.

    Raises:
        InputError: there is no name, only Python code has it, or the new name has a wrong form or is in use.
    """
    index = view.index
    names = index.around(view.page.file, offset)
    if not names:
        raise InputError("there is no name at the cursor")
    if names[0].kind == "skill":
        raise InputError(f"a skill is not renamed here, as Python code names it: {names[0].name}", found=names[0].name)
    return _rename(view.pages, index, names, new.removeprefix("?"), view.root)


def rename_named(
    root: Path, kind: str, old: str, new: str, texts: Mapping[Path, str] = MappingProxyType({})
) -> tuple[Rename, dict[Path, str]]:
    """Return the edits that rename a name in the texts of a folder, with the new texts by file.

    Args:
        root: the folder of the project.
        kind: one of `KINDS`.
        old: the name; `PLOT.NAME` if several plots define the name.
        new: the new name.
        texts: unsaved texts, in place of those on disk.

    Raises:
        InputError: as for `rename_at`; or the kind is unknown, or no name or several names fit.
    """
    if kind not in KINDS:
        raise InputError(f"there is no kind of names '{kind}'", found=kind, valid=KINDS)
    pages = Workspace().pages(root, texts)
    index = NameIndex(pages)
    names = list(index.definitions(KINDS[kind]))
    meant = [one for one in names if old in {one.name, _full(one)}]
    if not meant:
        valid = {word for one in names for word in (one.name, _full(one))}
        raise InputError(f"no text in {root} defines the {kind} '{old}'", found=old, valid=valid)
    same = {one.identity for _, one in index.places(meant[:1])}
    if others := [one for one in meant if one.identity not in same]:
        full = sorted(_full(one) for one in (meant[0], *others))
        raise InputError(f"several plots define the {kind} '{old}'; write one of {', '.join(full)}", found=old)
    found = _rename(pages, index, meant[:1], new, root)
    return found, {page.file: patch(page.text, found.edits[page.file]) for page in pages if page.file in found.edits}


def _full(name: Occurrence) -> str:
    """Return a name with its plot or action, e.g. `take.item`."""
    return f"{name.scope.rpartition(' ')[2]}.{name.name}" if name.scope else name.name


def _rename(pages: Sequence[Page], index: NameIndex, names: list[Occurrence], new: str, root: Path) -> Rename:
    kind, old = names[0].kind, names[0].name
    places = index.places(names)
    if stale := next((page for page in pages if not page.fresh), None):
        raise InputError(f"nothing is renamed while a file cannot be read: {stale.file}")
    if not any(one.defines for _, one in places):
        raise InputError(f"the definition of '{old}' is not among the project's texts", found=old)
    if _NAME.fullmatch(new) is None:
        raise InputError(f"'{new}' is not a name: letters, digits, '_' and '-', with a letter first", found=new)
    for name in (old, new):
        if name.lower() in _TAKEN.get(kind, ()):
            raise InputError(f"'{name}' is a reserved {kind}; only other names are renamed", found=name)
    identities = {one.identity for _, one in places}
    in_use = any(index.has(kind, new, scope) for kind, _, scope in identities)
    if in_use and new.lower() != old.lower():
        raise InputError(f"there is a {kind} '{new}' already", found=new)
    edits = {page.file: tuple(_edits(page, places, new)) for page, _ in places}
    for page in {page.file: page for page, _ in places}.values():
        _verify(page, edits[page.file], new)
    if kind == "state":
        return Rename(edits, (), ())
    in_texts = () if kind == "variable" else tuple(lines_in_texts(pages, old, places))
    return Rename(edits, tuple(lines_in_python(root, _spellings(names[0]))), in_texts)


def _edits(page: Page, places: Iterable[tuple[Page, Occurrence]], new: str) -> Iterator[TextEdit]:
    """Yield the edits of one page; quotes stay."""
    spans = {(one.begin, one.end) for of, one in places if of is page}
    for begin, end in sorted(spans):
        quote = page.text[begin] if page.text[begin] in {"'", '"'} else ""
        yield TextEdit(begin, end, f"{quote}{new}{quote}")


def _verify(page: Page, edits: tuple[TextEdit, ...], new: str) -> None:
    """Require a text in which the new name is read as a name at each place."""
    text = patch(page.text, edits)
    after = Workspace().page(page.file, text)
    if page.kind is Kind.PLOT and after.fresh:
        parse_plot(text, str(page.file))
    had, has = ({one.begin: one.name for one in each.names} for each in (page, after))
    added = sum(name == new for name in has.values()) - sum(name == new for name in had.values())
    if not after.fresh or len(had) != len(has) or added != len(edits):
        raise InputError(f"in {page.file}, '{new}' would not be read as a name everywhere; choose another", found=new)


def _spellings(name: Occurrence) -> str:
    """Return the pattern of a name in Python: in quotes, or as a class."""
    word = rf"""["']{re.escape(name.name)}["']"""
    return rf"{word}|\bclass {type_class(name.name)}\b" if name.kind in _CLASSES else word
