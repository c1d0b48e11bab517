"""Definitions, references, renames, hover texts and outlines, from the names of a project's texts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dsc.editing.cursor import cursor_at
from dsc.editing.keys import keys_at, plot_form, profile_form
from dsc.editing.kinds import Kind
from dsc.editing.names import Occurrence
from dsc.editing.view import View
from dsc.editing.workspace import Page


@dataclass(frozen=True, slots=True)
class Range:
    """A span of a text; `line` counts from 0 and replaces the span in Python code."""

    file: Path
    begin: int = 0
    end: int = 0
    line: int | None = None


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
    names = view.index.around(view.page.file, offset)
    if not names:
        return []
    name = names[0]
    if name.kind == "skill":
        skill = view.facts.skill(name.name)
        file, _, line = ("" if skill is None else skill.place).rpartition(":")
        return [Range(Path(file), line=int(line) - 1)] if file and line.isdigit() else []
    found = [_range(page, one) for page, one in view.index.places(names) if one.defines]
    file = view.facts.plots.get(name.name, "") if name.kind == "plot" else ""
    return found or ([Range(Path(file), line=0)] if file else [])


def references(view: View, offset: int) -> list[Range]:
    """Return all places of the name at an offset, its definitions among them."""
    names = view.index.around(view.page.file, offset)
    return _distinct(_range(page, one) for page, one in view.index.places(names))


def hover(view: View, offset: int) -> str:
    """Return the text about the name or key at an offset, in Markdown; empty without any."""
    if text := about_name(view, offset):
        return text
    key = next((path for path, (begin, end) in view.page.spans.keys.items() if begin <= offset <= end), None)
    if key is None or not view.page.fresh:
        return ""
    forms = {Kind.PLOT: plot_form(), Kind.PROFILE: profile_form(), Kind.SCENARIO: view.facts.scenario or {}}
    path = cursor_at(view.page.text, view.page.spans.keys[key][0]).path
    about = keys_at(forms.get(view.page.kind, {}), path).get(str(key[-1]), "")
    return f"`{key[-1]}`: {about}" if about else ""


def about_name(view: View, offset: int) -> str:
    """Return the text about the name at an offset, in Markdown; empty without any."""
    names = view.index.around(view.page.file, offset)
    if not names:
        return ""
    name = names[0]
    if name.kind == "skill":
        skill = view.facts.skill(name.name)
        if skill is None:
            return ""
        given = ", ".join(f"{one}: {kind or 'any'}" for one, kind in skill.parameters.items())
        text = f"`{name.name}({given})`\n\nends with {', '.join(f'`{one}`' for one in skill.outcomes)}"
        return "\n\n".join(filter(None, [text, view.facts.about.get(name.name, "").strip()]))
    found = [one.about for _, one in view.index.places(names) if one.defines and one.about]
    kind = {"variable": "parameter or variable"}.get(name.kind, name.kind)
    if found:
        return found[0] if name.kind == "plot" else f"{kind} `{name.name}`: {found[0]}"
    objects = view.facts.objects or {}
    if name.kind == "object" and name.name in objects:
        return f"object `{name.name}` of type `{objects[name.name]}`"
    return f"{kind} `{name.name}`" if name.kind in {"state", "variable"} else ""


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
