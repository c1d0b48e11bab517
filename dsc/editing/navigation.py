"""Definitions, references, renames, hover texts and outlines, from the names of a project's texts."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dsc.editing.cursor import cursor_at
from dsc.editing.keys import keys_at, plot_form, profile_form
from dsc.editing.kinds import Kind
from dsc.editing.names import Occurrence
from dsc.editing.workspace import Page, View, places_in_python
from knowledge_base.errors import InputError

RENAMES = frozenset({"state", "variable", "relation", "action", "type"})
"""The kinds of names that a rename changes; Python code often has the names of the other kinds."""
_NAME = re.compile(r"[A-Za-z_][\w\-]*")


@dataclass(frozen=True, slots=True)
class Range:
    """A span of a text; `line` counts from 0 and replaces the span in Python code."""

    file: Path
    begin: int = 0
    end: int = 0
    line: int | None = None


@dataclass(frozen=True, slots=True)
class Rename:
    """The edits of a rename, and the places in Python that are left to the author."""

    edits: tuple[Range, ...]
    in_python: tuple[tuple[Path, int], ...]


@dataclass(frozen=True, slots=True)
class Symbol:
    """A part of an outline: a plot, state, parameter, action or declaration."""

    name: str
    kind: str
    begin: int
    end: int
    name_begin: int
    name_end: int
    inside: tuple[Symbol, ...] = ()


def definitions(view: View, offset: int) -> list[Range]:
    """Return where the name at an offset is defined; a skill is defined in Python code."""
    name = view.page.name_at(offset)
    if name is None:
        return []
    if name.kind == "skill":
        skill = view.facts.skill(name.name)
        file, _, line = ("" if skill is None else skill.place).rpartition(":")
        return [Range(Path(file), line=int(line) - 1)] if file and line.isdigit() else []
    found = [_range(page, one) for page, one in _places(view, view.page, offset) if one.defines]
    file = view.facts.plots.get(name.name, "") if name.kind == "plot" else ""
    return found or ([Range(Path(file), line=0)] if file else [])


def references(view: View, offset: int) -> list[Range]:
    """Return all places of the name at an offset, its definitions among them."""
    return _distinct(_range(page, one) for page, one in _places(view, view.page, offset))


def rename(view: View, offset: int, new: str) -> Rename:
    """Return the edits that rename the name at an offset in all texts of the project.

    Raises:
        InputError: there is no name, its kind cannot be renamed, the new name has a wrong form or is taken.
    """
    name = _renamable(view, offset)
    new = new.removeprefix("?")
    if _NAME.fullmatch(new) is None:
        raise InputError(f"'{new}' is not a name: letters, digits, '_' and '-', with a letter first", found=new)
    places = list(_places(view, view.page, offset))
    stale = [str(page.file) for page in view.pages if not page.fresh]
    if stale:
        raise InputError(f"nothing is renamed while a file cannot be read: {stale[0]}")
    kinds = {(one.kind, one.scope) for _, one in places}
    taken = [one for _, one in view.names() if one.defines and one.name == new and (one.kind, one.scope) in kinds]
    if taken and new != name.name:
        raise InputError(f"there is a {name.kind} '{new}' already", found=new)
    python = places_in_python(view.root, name.name) if name.kind != "state" else []
    return Rename(tuple(_distinct(_range(page, one) for page, one in places)), tuple(python))


def _renamable(view: View, offset: int) -> Occurrence:
    name = view.page.name_at(offset)
    if name is None:
        raise InputError("there is no name at the cursor")
    if name.kind not in RENAMES:
        raise InputError(f"a {name.kind} is not renamed here, as Python code names it", found=name.name)
    if not any(one.defines for _, one in _places(view, view.page, offset)):
        raise InputError(f"the definition of '{name.name}' is not among the project's texts", found=name.name)
    return name


def hover(view: View, offset: int) -> str:
    """Return the text about the name or key at an offset, in Markdown; empty without any."""
    name = view.page.name_at(offset)
    if name is not None and (text := _about(view, name, offset)):
        return text
    key = next((path for path, (begin, end) in view.page.spans.keys.items() if begin <= offset <= end), None)
    if key is None or not view.page.fresh:
        return ""
    forms = {Kind.PLOT: plot_form(), Kind.PROFILE: profile_form(), Kind.SCENARIO: view.facts.scenario or {}}
    path = cursor_at(view.page.text, view.page.spans.keys[key][0]).path
    about = keys_at(forms.get(view.page.kind, {}), path).get(str(key[-1]), "")
    return f"`{key[-1]}`: {about}" if about else ""


def _about(view: View, name: Occurrence, offset: int) -> str:
    if name.kind == "skill":
        skill = view.facts.skill(name.name)
        if skill is None:
            return ""
        given = ", ".join(f"{one}: {kind or 'any'}" for one, kind in skill.parameters.items())
        text = f"`{name.name}({given})`\n\nends with {', '.join(f'`{one}`' for one in skill.outcomes)}"
        return "\n\n".join(filter(None, [text, view.facts.about.get(name.name, "").strip()]))
    found = [one.about for _, one in _places(view, view.page, offset) if one.defines and one.about]
    kind = {"variable": "parameter or variable"}.get(name.kind, name.kind)
    if found:
        return found[0] if name.kind == "plot" else f"{kind} `{name.name}`: {found[0]}"
    objects = view.facts.objects or {}
    if name.kind == "object" and name.name in objects:
        return f"object `{name.name}` of type `{objects[name.name]}`"
    return f"{kind} `{name.name}`" if name.kind in {"state", "variable"} else ""


def _places(view: View, page: Page, offset: int) -> Iterator[tuple[Page, Occurrence]]:
    """Yield the places of the names at an offset, and of names that have a place in common with them."""
    waiting = [one for one in page.names if one.begin <= offset <= one.end] if page.fresh else []
    every = [(one_page, one) for one_page, one in view.names() if one_page.fresh]
    at_place: dict[tuple[Path, int], list[Occurrence]] = {}
    for one_page, one in every:
        at_place.setdefault((one_page.file, one.begin), []).append(one)
    met: list[Occurrence] = []
    while waiting:
        name = waiting.pop()
        if any(name.means(one) for one in met):
            continue
        met.append(name)
        for one_page, one in every:
            if one.means(name):
                yield one_page, one
                waiting += [other for other in at_place[one_page.file, one.begin] if not other.means(name)]


def _range(page: Page, name: Occurrence) -> Range:
    return Range(page.file, name.begin, name.end)


def _distinct(ranges: Iterator[Range]) -> list[Range]:
    return sorted(set(ranges), key=lambda one: (str(one.file), one.begin))


def symbols(page: Page) -> list[Symbol]:
    """Return the outline of a page: the states of a plot as a tree, or the declarations and actions of PDDL."""
    if not page.fresh:
        return []
    if page.kind is Kind.PDDL:
        defined = [one for one in page.names if one.defines and one.kind != "variable"]
        return [Symbol(one.name, one.kind, one.begin, one.end, one.begin, one.end) for one in defined]
    defined = [one for one in page.names if one.defines and one.kind in {"state", "variable"}]
    whole = {page.spans.keys[path][0]: page.spans.values[path][1] for path in page.spans.keys}
    return _tree([(one, max(one.end, whole[one.begin])) for one in defined])


def _tree(names: list[tuple[Occurrence, int]]) -> list[Symbol]:
    found: list[Symbol] = []
    names = sorted(names, key=lambda pair: pair[0].begin)
    while names:
        (name, end), *names = names
        inside = [one for one in names if one[0].begin < end]
        names = names[len(inside) :]
        parts = tuple(_tree(inside))
        found.append(Symbol(name.name, name.kind, name.begin, end, name.begin, name.end, parts))
    return found
