"""Names in texts: each place at which a plot, profile or PDDL file defines a name or refers to it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from dsc.data_types import WORDS, data_type, names_in
from dsc.editing.plot_data import part_at, plots_in, used_plots
from dsc.editing.roles import PLOT, PROFILE, role_of
from dsc.text.yaml import Document, Spans
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import KEYWORDS
from knowledge_base.language.syntax.text import parse_condition

NameKind = Literal["state", "plot", "skill", "variable", "event", "relation", "type", "object", "action", "offer"]
"""The kind of a name.

A relation is a predicate or function. A variable is also a parameter or output of a plot. An offer is a name under
which dynamic states find candidates.
"""
ANY_STEP = "*"
"""All plots of planning actions, in `Occurrence.scopes`."""


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
        scopes: the possible scopes, if other files decide: every scope that defines the name, else the last one.
    """

    kind: NameKind
    name: str
    begin: int
    end: int
    defines: bool = False
    scope: str = ""
    about: str = ""
    scopes: tuple[str, ...] = ()

    @property
    def identity(self) -> tuple[NameKind, str, str]:
        """Kind, name and scope, which all places of one name have in common."""
        return self.kind, self.name if self.scope else self.name.lower(), self.scope

    def means(self, other: Occurrence) -> bool:
        """Return whether both are places of the same name."""
        return self.identity == other.identity


_VALUES: Mapping[str, NameKind] = {
    "target": "state", "ways": "state", "way": "state", "cases": "state", "plot": "plot", "plots": "plot",
    "skill": "skill", "action": "action", "name": "plot", "history": "state", "variable": "variable", "offer": "offer",
    "value": "object",
}  # fmt: skip
_KEYS: Mapping[str, NameKind] = {
    "states": "state", "parameters": "variable", "variables": "variable", "records": "type",
}  # fmt: skip
_OF_PLOT = frozenset({"state", "variable"})
"""Kinds of names that are valid in one plot."""
_TOKEN = re.compile(r"""(?P<head>\(\s*)?(?P<word>\??[^\s()"';{}\[\],]+)""")
_IN_STATE = "in-state"
_PATHS = frozenset({"dsc:active", "dsc:running", "dsc:executes", "dsc:waits"})
"""Relations whose first argument is the path of a state."""
_SYMBOL = re.compile(r"[A-Za-z_][\w\-]*")
_SEGMENT = re.compile(r"[^/]+")
_SENTENCE = re.compile(r'"[^"]*\s[^"]*"')
"""A text of several words, without names."""
_COMPONENT_VALUE = re.compile(r"(?<![\w\-])[A-Za-z_][\w\-]*\.\w")
_SILENT = re.compile(r"\(\s*silent\s+$")
_BRACKET = re.compile(r"[()]")


def plot_names(document: Document, spans: Spans, text: str) -> Iterator[Occurrence]:
    """Yield the names in the document of a plot."""
    data = document.data if isinstance(document.data, dict) else {}
    plot = str(data.get("plot", ""))
    robot: Any = data.get("robot")
    robot = robot if isinstance(robot, dict) else {}
    groups = [data.get(group) for group in ("parameters", "variables", "outputs")]
    groups += [robot.get(group) for group in ("sensors", "motors", "constants", "activities")]
    own = {name for group in groups for name in group or {}}
    states = {path[-1] for path in spans.keys if role_of(PLOT, path[:-1]) == "states"}
    yield from _key_names(data, spans, plot, own)
    yield from event_names(data, spans, text)
    for path, (begin, end) in spans.values.items():
        value, role = part_at(data, path), role_of(PLOT, path)
        if not isinstance(value, str) or (path[-1:] == ("about",) and role != "value"):
            continue
        if (written := value.lstrip()[:2])[:1] in {"(", "?"}:
            yield from expression_names(*_inner(text, begin, end), plot, own)
        elif written == '"(':
            yield from condition_text_names(value, *_inner(text, begin, end), plot)
        elif role in {"type", "declaration"}:
            yield from _type_names(value, text[begin:end], begin)
        elif (role in _VALUES or role == "step") and (role != "value" or _SYMBOL.fullmatch(value)):
            kind = _VALUES.get(role) or ("state" if value in states else "action")
            start = begin + (text[begin : begin + 1] in {"'", '"'})
            scope, about = (plot if kind in _OF_PLOT else ""), (_signature(data) if role == "name" else "")
            name = value.removesuffix("*") if role == "history" else value
            defines = role == "name" or path[0] == "offers"
            yield Occurrence(kind, name, start, start + len(name), defines, scope, about)


def _key_names(data: Mapping[str, Any], spans: Spans, plot: str, own: set[str]) -> Iterator[Occurrence]:
    """Yield the names that are keys: of states, variables, records, and of parameters that receive arguments."""
    for path, (begin, end) in spans.keys.items():
        role, name = role_of(PLOT, path[:-1]), str(path[-1])
        if role in _KEYS:
            scope = plot if _KEYS[role] in _OF_PLOT else ""
            yield Occurrence(_KEYS[role], name, begin, end, True, scope, _about(part_at(data, path)))  # noqa: FBT003
            if role == "parameters" and data.get("implements"):
                yield Occurrence("variable", name, begin, end, False, f"action {data['implements']}")  # noqa: FBT003
        elif role == "cases" and _SYMBOL.fullmatch(name):
            yield Occurrence("object", name, begin, end)
        elif role == "assigned" and name in own:
            yield Occurrence("variable", name, begin, end, scope=plot)
        elif role == "arguments":
            for used in used_plots(part_at(data, path[:-2])):
                yield Occurrence("variable", name, begin, end, scope=used)
        elif role == "passed":
            yield Occurrence("variable", name, begin, end, scopes=(*plots_in(data), ANY_STEP, ""))


def event_names(data: Mapping[str, Any], spans: Spans, text: str) -> Iterator[Occurrence]:
    """Yield the names of events in a plot: its outcomes, events from outside, and events inside.

    The outcomes of a plot have its name as their scope, and its inner events `inside PLOT`.
    """
    plot, outcomes = str(data.get("plot", "")), data.get("emits") or {}
    inside = f"inside {plot}"
    for path, (begin, end) in spans.keys.items():
        role, name = role_of(PLOT, path[:-1]), str(path[-1])
        if role == "events":
            scope = plot if path[0] == "emits" else ""
            yield Occurrence("event", name, begin, end, True, scope, _about(part_at(data, path)))  # noqa: FBT003
        elif role == "on":
            used = plots_in(part_at(data, path[:-2]))
            yield Occurrence("event", name, begin, end, scopes=(*used, "", inside))
        elif role == "answers":
            yield Occurrence("event", name, begin, end, scopes=(*used_plots(part_at(data, path[:-2])), inside))
    for path, (begin, end) in spans.values.items():
        value = part_at(data, path)
        if role_of(PLOT, path) != "event" or not isinstance(value, str):
            continue
        span = (begin + (text[begin : begin + 1] in {"'", '"'}), end - (text[end - 1 : end] in {"'", '"'}))
        if path[-1] == "on":
            yield Occurrence("event", value, *span, scopes=(*plots_in(data), ANY_STEP, "", inside))
        else:
            yield Occurrence("event", value, *span, value not in outcomes, plot if value in outcomes else inside)


def _type_names(value: str, text: str, start: int) -> Iterator[Occurrence]:
    """Yield the types of the domain and the records in the text of a type."""
    try:
        named = {*names_in(data_type(value))} - {*WORDS}
    except InputError:
        return
    for name in named:
        for match in re.finditer(rf"(?<![\w\-]){re.escape(name)}(?![\w\-])", text):
            yield Occurrence("type", name, start + match.start(), start + match.end())


def profile_names(data: Any, spans: Spans) -> Iterator[Occurrence]:
    """Yield the names of plots, variables, states and objects in a profile."""
    for path, (begin, end) in spans.keys.items():
        role, name = role_of(PROFILE, path[:-1]), str(path[-1])
        if role == "settings":
            yield Occurrence("plot", name, begin, end)
        elif role == "values":
            yield Occurrence("state" if path[0] == "choose" else "variable", name, begin, end, scope=str(path[1]))
    for path, (begin, end) in spans.values.items():
        value = part_at(data, path)
        if path[:1] == ("plots",) and isinstance(value, str) and _SYMBOL.fullmatch(value):
            yield Occurrence("object", value, begin, end)


def expression_names(text: str, start: int, scope: str, variables: Iterable[str]) -> Iterator[Occurrence]:
    """Yield the names in the text of a condition, effect or term that begins at an offset of a plot."""
    before = ""
    for match in _TOKEN.finditer(_SENTENCE.sub(lambda found: " " * len(found[0]), text)):
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


def condition_text_names(value: str, written: str, start: int, scope: str) -> Iterator[Occurrence]:
    """Yield the names in a text that is a condition, e.g. of `conditions.watch_truth`; none in any other text.

    The values and ports of components, e.g. `hand.pose`, and the checks of these values have their names in Python.
    """
    try:
        parse_condition(value.strip().strip('"'))
    except InputError:
        return
    for one in expression_names(written, start, scope, ()):
        at = one.begin - start
        is_check = one.kind == "relation" and _COMPONENT_VALUE.search(_group(written, at))
        if not ("." in one.name or is_check or _SILENT.search(written, 0, at)):
            yield one


def scenario_names(data: Any, spans: Spans, text: str) -> Iterator[Occurrence]:
    """Yield the objects that a scenario may name, and the names in its conditions.

    A key of the outermost mapping is a word of the simulation.
    """
    for path, (begin, end) in spans.keys.items():
        if len(path) > 1 and _SYMBOL.fullmatch(str(path[-1])):
            yield Occurrence("object", str(path[-1]), begin, end)
    for path, (begin, end) in spans.values.items():
        value = part_at(data, path)
        if isinstance(value, str) and value.lstrip()[:1] == "(":
            yield from expression_names(*_inner(text, begin, end), "", ())
        elif isinstance(value, str) and _SYMBOL.fullmatch(value):
            yield Occurrence("object", value, begin, end)


def _inner(text: str, begin: int, end: int) -> tuple[str, int]:
    """Return the brackets in a written value, with their offset; the whole value without brackets."""
    first, last = text.find("(", begin, end), text.rfind(")", begin, end)
    return (text[begin:end], begin) if first < 0 or last < 0 else (text[first : last + 1], first)


def _group(text: str, at: int) -> str:
    """Return the rest of the brackets around an offset."""
    depth = 1
    for bracket in _BRACKET.finditer(text, at):
        depth += 1 if bracket[0] == "(" else -1
        if depth == 0:
            return text[at : bracket.start()]
    return text[at:]


def variables_in(data: Any) -> set[str]:
    """Return the names of all variables in the conditions, effects and terms of a plot's data.

    The variables of conditions in texts are not among them: these conditions receive their own `values`.
    """
    if isinstance(data, str):
        return set() if data.lstrip()[:2] == '"(' else {found.lower() for found in _VARIABLE.findall(data)}
    inside = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    return {name for one in inside for name in variables_in(one)}


_VARIABLE = re.compile(r"\?([\w\-]+)")


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
