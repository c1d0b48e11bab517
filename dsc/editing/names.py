"""Names in texts: each place at which a plot, profile or PDDL file defines a name or refers to it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from dsc.editing.roles import PLOT, PROFILE, role_of
from dsc.text.yaml import Document, Spans
from knowledge_base.language.syntax.expression import KEYWORDS

NameKind = Literal["state", "plot", "skill", "variable", "event", "relation", "type", "object", "action"]
"""The kind of a name; a relation is a predicate or function, and a variable is also a parameter or output of a plot."""


@dataclass(frozen=True, slots=True)
class Occurrence:
    """A name at a place of a text.

    Attributes:
        kind: the kind of the name.
        name: the name, without the `?` of a variable.
        begin, end: the span in the text, in characters.
        defines: whether the name is defined here.
        scope: the plot or `action NAME` in which the name is valid; empty for names of the whole project.
        about: a line about a defined name.
    """

    kind: NameKind
    name: str
    begin: int
    end: int
    defines: bool = False
    scope: str = ""
    about: str = ""

    def means(self, other: Occurrence) -> bool:
        """Return whether both are places of the same name."""
        mine, its = (one.name if one.scope else one.name.lower() for one in (self, other))
        return (self.kind, mine, self.scope) == (other.kind, its, other.scope)


_VALUES: Mapping[str, NameKind] = {
    "target": "state", "ways": "state", "way": "state", "cases": "state", "plot": "plot", "plots": "plot",
    "skill": "skill", "action": "action", "event": "event", "type": "type", "name": "plot", "history": "state",
    "variable": "variable",
}  # fmt: skip
_KEYS: Mapping[str, NameKind] = {
    "states": "state", "parameters": "variable", "variables": "variable", "on": "event", "events": "event",
}  # fmt: skip
_OF_PLOT = frozenset({"state", "variable"})
"""Kinds of names that are valid in one plot."""
_TOKEN = re.compile(r"""(?P<head>\(\s*)?(?P<word>\??[^\s()"';{}\[\],]+)""")
_IN_STATE = "in-state"
_PATHS = frozenset({"dsc:active", "dsc:running", "dsc:executes", "dsc:waits"})
"""Relations whose first argument is the path of a state."""
_SEGMENT = re.compile(r"[^/]+")


def plot_names(document: Document, spans: Spans, text: str) -> Iterator[Occurrence]:
    """Yield the names in the document of a plot."""
    data = document.data if isinstance(document.data, dict) else {}
    plot = str(data.get("plot", ""))
    own = {name for group in ("parameters", "variables", "outputs") for name in data.get(group) or {}}
    for path, (begin, end) in spans.keys.items():
        role, name = role_of(PLOT, path[:-1]), str(path[-1])
        if role in _KEYS:
            scope = plot if _KEYS[role] in _OF_PLOT else ""
            yield Occurrence(_KEYS[role], name, begin, end, role != "on", scope, _about(_part(data, path)))
            if role == "parameters" and data.get("implements"):
                yield Occurrence("variable", name, begin, end, False, f"action {data['implements']}")  # noqa: FBT003
        elif role == "assigned" and name in own:
            yield Occurrence("variable", name, begin, end, scope=plot)
        elif role == "arguments":
            for used in used_plots(_part(data, path[:-2])):
                yield Occurrence("variable", name, begin, end, scope=used)
    for path, (begin, end) in spans.values.items():
        value, role = _part(data, path), role_of(PLOT, path)
        if not isinstance(value, str) or path[-1:] == ("about",):
            continue
        if value[:1] in {"(", "?"}:
            yield from expression_names(text[begin:end], begin, plot, own)
        elif role in _VALUES:
            kind = _VALUES[role]
            start = begin + (text[begin : begin + 1] in {"'", '"'})
            scope, about = (plot if kind in _OF_PLOT else ""), (_signature(data) if role == "name" else "")
            name = value.removesuffix("*") if role == "history" else value
            yield Occurrence(kind, name, start, start + len(name), role == "name", scope, about)


def profile_names(spans: Spans) -> Iterator[Occurrence]:
    """Yield the names of plots, parameters and states in a profile."""
    for path, (begin, end) in spans.keys.items():
        role, name = role_of(PROFILE, path[:-1]), str(path[-1])
        if role == "settings":
            yield Occurrence("plot", name, begin, end)
        elif role == "values":
            yield Occurrence("variable" if path[0] == "plots" else "state", name, begin, end, scope=str(path[1]))


def expression_names(text: str, start: int, scope: str, variables: Iterable[str]) -> Iterator[Occurrence]:
    """Yield the names in the text of a condition, effect or term that begins at an offset of a plot."""
    before = ""
    for match in _TOKEN.finditer(text):
        word, begin = match["word"], start + match.start("word")
        name = word.removeprefix("?")
        if word.startswith("?"):
            if name.lower() in variables:
                yield Occurrence("variable", name.lower(), begin + 1, begin + len(word), scope=scope)
        elif before.lower() == _IN_STATE:
            yield Occurrence("state", word, begin, begin + len(word), scope=scope)
        elif before in _PATHS:
            for part in _SEGMENT.finditer(word):
                yield Occurrence("state", part[0], begin + part.start(), begin + part.end(), scope=scope)
        elif word not in KEYWORDS and name[:1].isalpha():
            kind: NameKind = "relation" if match["head"] else "type" if before == "-" else "object"
            yield Occurrence(kind, name, begin, begin + len(word))
        before = word


def variables_in(data: Any) -> set[str]:
    """Return the names of all variables in the conditions, effects and terms of a plot's data."""
    if isinstance(data, str):
        return {found.lower() for found in _VARIABLE.findall(data)}
    inside = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    return {name for one in inside for name in variables_in(one)}


_VARIABLE = re.compile(r"\?([\w\-]+)")


def _part(data: Any, path: Iterable[str | int]) -> Any:
    """Return the part of data at a path; `None` if there is none."""
    for key in path:
        try:
            data = data[key]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def used_plots(state: Any) -> list[str]:
    """Return the names of the plots that a state, or a reaction of a rule, uses."""
    if not isinstance(state, dict):
        return []
    use, dynamic = state.get("use"), state.get("dynamic")
    names = [use] if isinstance(use, str) else []
    return names + [one for one in (dynamic if isinstance(dynamic, list) else []) if isinstance(one, str)]


def _about(value: Any) -> str:
    if isinstance(value, dict):
        return str(value.get("about") or value.get("type") or "")
    return value if isinstance(value, str) else ""


def _signature(data: Mapping[str, Any]) -> str:
    """Return parameters, outcomes and description of a plot, as lines of Markdown."""
    parameters = data.get("parameters") or {}
    given = ", ".join(f"{name}: {_about(kind)}" for name, kind in parameters.items())
    lines = [f"`{data.get('plot')}({given})`"]
    if data.get("emits"):
        lines.append(f"ends with `done`, {', '.join(f'`{one}`' for one in data['emits'])}")
    return "\n\n".join([*lines, *([str(data["about"])] if data.get("about") else [])])
