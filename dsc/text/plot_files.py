"""Plot files: conversion between YAML and `ActionPlot`, JSON Schema, and related plots of a folder."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.model.reading import FormPath
from dsc.model.states import DynamicState
from dsc.model.transitions import case_value
from dsc.text.yaml import Document, dump, load_document, path_of, read_file, read_model
from knowledge_base.errors import InputError, Place, tolerated
from knowledge_base.origin import origin_of


def parse_plot(text: str, source: str | None = None) -> ActionPlot:
    """Return the plot that YAML text contains; `source` is the file name in messages.

    Raises:
        InputError: the text is not a plot; the message has the place and the nearest valid key.
    """
    return plot_in(load_document(text, origin_of(text, source)))


def plot_in(document: Document) -> ActionPlot:
    """Return the plot in a YAML document; errors as for `parse_plot`."""
    if isinstance(document.data, Mapping) and "profile" in document.data and "plot" not in document.data:
        message = "this is a profile, not a plot; `dsc check` validates profiles"
        raise InputError(message, place=document.place(("profile",)))
    return read_model(ActionPlot, document).written_at(document.places)


def load_plot(path: Path | str) -> ActionPlot:
    """Return the plot in a plot file; errors as for `parse_plot` and `read_file`."""
    return parse_plot(read_file(path), str(path))


def file_of(plot: ActionPlot) -> Path | None:
    """Return the plot file from which a plot was read; `None` for a plot that a program contains or makes."""
    place = plot.place(("plot",))
    file = None if place is None or place.source is None else Path(place.source)
    return None if file is None or file.suffix not in _SUFFIXES else file


_SUFFIXES = frozenset({".yaml", ".yml", ".json", ".scxml", ".xml"})


def load_library(folder: Path | str) -> Library:
    """Return a library of all plots (`*.yaml`) of a folder, in the order of file names.

    Raises:
        InputError: the folder is missing, a file is not a plot, or two plots have an equal name.
    """
    files = sorted(path_of(folder).glob("*.yaml"))
    if not files:
        raise InputError(f"there are no plots (*.yaml) in '{folder}'", place=Place(str(folder)))
    library = Library()
    for file in files:
        with tolerated():
            library.add(load_plot(file))
    return library


def plot_to_yaml(plot: ActionPlot) -> str:
    """Return the plot as YAML with all short forms; `parse_plot` returns an equal plot."""
    return dump(_short(plot.to_form()))


_ORDER = (
    "plot", "about", "generated", "implements", "effects", "confirm", "parameters", "variables", "outputs", "robot",
    "sensors", "motors", "constants", "operations", "activities", "start", "stop", "receives", "emits", "seconds",
    "set", "switch", "send", "to", "pass", "before", "when", "offers", "utility", "cost", "of", "interrupt",
    "listen", "trigger", "use", "dynamic", "choose", "exclude", "situation", "explore", "bind", "bind_all",
    "order_by", "assign", "perform", "tell", "emit", "command", "with", "as", "within", "goal", "budget", "clear",
    "do", "then", "limit", "rule", "choice", "select", "cases", "else", "entry", "at_least", "initial", "final",
    "states", "regions", "on", "after", "every", "always", "exit", "on_break", "rules", "handlers",
)  # fmt: skip
"""Keys of a plot file in the order in which they are written."""
_SINGLE = frozenset({
    "entry", "exit", "on_break", "before", "after", "every", "always", "event", "clear", "command", "offers",
    "order_by",
})  # fmt: skip
"""Keys of lists that may be written as their only element; `event` stands for the transitions of an event."""
_NAMES = {
    "on": "event", "states": "state", "connectors": "state", "regions": "region", "cases": "transition",
    "parameters": "declaration", "variables": "declaration", "outputs": "declaration",
    "sensors": "declaration", "motors": "declaration", "constants": "value", "operations": "value",
    "emits": "attributes", "receives": "attributes", "with": "value", "pass": "value", "as": "value",
    "assign": "value", "bind": "value", "bind_all": "value",
}  # fmt: skip
"""Kind of the values, by the key of each mapping whose own keys are names and keep their order."""


def _short(node: Any, role: str = "plot") -> Any:
    """Return data in short form: shorten lists of one and mappings with only `to` or `type`, and order the keys."""
    if isinstance(node, list):
        short = [_short(one, "transition" if role in {"event", "always", "choice"} else "element") for one in node]
        return short[0] if len(short) == 1 and role in _SINGLE else short
    if not isinstance(node, dict) or role == "attributes":
        return node
    if role in _NAMES:
        return {_key(name, role): _short(one, _NAMES[role]) for name, one in node.items()}
    if role in {"event", "transition", "else"} and set(node) == {"to"}:
        return node["to"]
    if role == "declaration" and set(node) == {"type"}:
        return node["type"]
    keys = list(node) if "do" in node else sorted(node, key=_rank)
    return {key: _short(node[key], key) for key in keys}


def _key(name: str, role: str) -> str | int | float:
    """Return the key of a case as the constant that YAML writes; return every other key unchanged."""
    value = case_value(name) if role == "cases" else name
    return name if isinstance(value, str) else value


def may_be_single(path: FormPath) -> bool:
    """Return whether the list at a path may be written as its only element."""
    return path[-1:] != () and (path[-1] in _SINGLE | {"choice", "of"} or path[-2:-1] == ("on",))


def place_of_key(keys: Iterable[str | int], key: str | int, path: FormPath) -> int:
    """Return the usual position of a new key in the mapping at a path; new names are the last."""
    known = [*keys]
    if path[-1:] and path[-1] in _NAMES:
        return len(known)
    before = [number for number, one in enumerate(known, 1) if _rank(str(one)) <= _rank(str(key))]
    return max(before, default=0)


def _rank(key: str) -> int:
    return _ORDER.index(key) if key in _ORDER else 0


_DECLARES = re.compile(r"""\bplot["']?\s*:\s*["']?([\w\-#.]+)""")


class Neighbours:
    """A cache of plot folders: each file is read once for all plots of its folder.

    Args:
        parse: returns the plot in a text with a source, as `parse_plot` does.
    """

    def __init__(self, parse: Callable[[str, str], ActionPlot] = parse_plot) -> None:
        self._parse = parse
        self._folders: dict[Path, dict[Path, str | InputError]] = {}
        self._plots: dict[Path, ActionPlot | InputError] = {}

    def of(self, file: Path, plot: ActionPlot) -> tuple[Library, list[InputError]]:
        """Return a library of a plot and its related plots, and the errors of unreadable files.

        Related plots are all plots that the plot uses, directly or indirectly. With rules or plans, these include the
        implementations of planning actions. If a related plot is missing, all plots of the folder are read, so that a
        message can report similar names.
        """
        library, broken = Library([plot]), list[InputError]()
        planned = any(isinstance(state, DynamicState) for _, state, _ in plot.walk())
        if not (plot.uses() or plot.rules or planned):
            return library, broken
        here, texts = os.path.realpath(file), self._texts(file.parent)
        left = {other: text for other, text in texts.items() if os.path.realpath(other) != here}
        actions = bool(plot.rules) or planned
        while True:
            missing = {name for known in library for name in known.uses() if name not in library}
            next_ = list(_holding(left, missing, actions=actions)) or (list(left) if missing else [])
            if not next_:
                return library, broken
            for other in next_:
                found = self._plot(other, left.pop(other))
                try:
                    if isinstance(found, InputError):
                        raise found
                    library.add(found)
                except InputError as error:
                    broken.append(error)

    def _texts(self, folder: Path) -> dict[Path, str | InputError]:
        if folder not in self._folders:
            self._folders[folder] = {file: _text(file) for file in sorted(folder.glob("*.yaml"))}
        return self._folders[folder]

    def _plot(self, file: Path, text: str | InputError) -> ActionPlot | InputError:
        if file not in self._plots:
            try:
                self._plots[file] = self._parse(text, str(file)) if isinstance(text, str) else text
            except InputError as error:
                self._plots[file] = error
        return self._plots[file]


def _holding(texts: dict[Path, str | InputError], names: set[str], *, actions: bool) -> Iterator[Path]:
    """Yield the files that may contain a plot in `names` or, with `actions`, one that implements or offers anything."""
    for file, text in texts.items():
        if isinstance(text, str) and (
            not names.isdisjoint(_DECLARES.findall(text)) or (actions and ("implements" in text or "offers" in text))
        ):
            yield file


def _text(file: Path) -> str | InputError:
    try:
        return read_file(file)
    except InputError as error:
        return error


_BY_NAME = frozenset({"Transition", "PlotParameter", "PlotVariable", "Sensor", "Device"})
"""Classes of values whose short form is only the target or the type."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of plot files, for editors; it accepts short and long forms of every plot."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "action plot",
        **_with_short_forms(ActionPlot.model_json_schema(by_alias=True)),
    }


def _with_short_forms(node: Any) -> Any:
    """Return the schema with the short forms as alternatives to the long forms."""
    if isinstance(node, list):
        return [_with_short_forms(one) for one in node]
    if not isinstance(node, dict):
        return node
    if str(node.get("$ref", "")).rsplit("/", 1)[-1] in _BY_NAME:
        return {"anyOf": [node, {"type": "string"}]}
    # Data without a distinctive key match several alternatives, which `oneOf` would refuse.
    schema = {"anyOf" if key == "oneOf" else key: _with_short_forms(value) for key, value in node.items()}
    if isinstance(schema.get("properties"), dict):
        schema["properties"] = {name: _property(name, one) for name, one in schema["properties"].items()}
    return schema


def _property(name: str, schema: dict[str, Any]) -> dict[str, Any]:
    inner = schema.get("additionalProperties")
    if name in _SINGLE | {"choice", "of"}:
        return _alone(schema)
    if name == "on" and isinstance(inner, dict):
        return {**schema, "additionalProperties": _alone(inner)}
    if name == "states" and isinstance(inner, dict):  # a state without a value, e.g. `over:`, is a simple state
        return {**schema, "additionalProperties": {"anyOf": [inner, {"type": "null"}]}}
    return schema


def _alone(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a schema that accepts a list or its only element; any other schema is returned unchanged."""
    return {"anyOf": [schema, schema["items"]]} if "items" in schema else schema
