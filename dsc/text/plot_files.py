"""Plot files: conversion between YAML and `ActionPlot`s."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dsc.dynamic.library import Library
from dsc.model.connectors import case_value
from dsc.model.plot import ActionPlot
from dsc.text.form import read_model
from dsc.text.text_files import path_of, read_file
from dsc.text.yaml import dump, load_document
from knowledge_base.errors import InputError, Place


def parse_plot(text: str, source: str | None = None) -> ActionPlot:
    """Read a plot from YAML text.

    Raises:
        InputError: it is not a plot; the message has the place and the nearest valid key.
    """
    document = load_document(text, source)
    return read_model(ActionPlot, document).written_at(document.places)


def load_plot(path: Path | str) -> ActionPlot:
    """Read a plot file; see `parse_plot`."""
    return parse_plot(read_file(path), str(path))


def load_library(folder: Path | str) -> Library:
    """Return all plots (`*.yaml`) of a folder, by file name.

    Raises:
        InputError: the folder is missing, a file is not a plot, or two plots have one name.
    """
    files = sorted(path_of(folder).glob("*.yaml"))
    if not files:
        raise InputError(f"there are no plots (*.yaml) in '{folder}'", place=Place(str(folder)))
    return Library(load_plot(file) for file in files)


def plot_to_yaml(plot: ActionPlot) -> str:
    """Return the plot as YAML in its short form; reading it gives the same plot."""
    return dump(_short(plot.to_form()))


_ORDER = (
    "plot",
    "about",
    "generated",
    "implements",
    "effects",
    "confirm",
    "parameters",
    "variables",
    "outputs",
    "receives",
    "emits",
    "seconds",
    "set",
    "switch",
    "send",
    "to",
    "pass",
    "before",
    "when",
    "of",
    "interrupt",
    "listen",
    "trigger",
    "use",
    "dynamic",
    "assign",
    "tell",
    "emit",
    "command",
    "with",
    "as",
    "within",
    "goal",
    "budget",
    "clear",
    "do",
    "then",
    "limit",
    "rule",
    "choice",
    "select",
    "cases",
    "else",
    "entry",
    "at_least",
    "initial",
    "final",
    "states",
    "regions",
    "on",
    "after",
    "every",
    "always",
    "exit",
    "on_break",
    "rules",
    "handlers",
)
_SINGLE = frozenset({
    "entry", "exit", "on_break", "before", "after", "every", "always", "event", "clear", "command",
})  # fmt: skip
_NAMES = {
    "on": "event", "states": "state", "connectors": "state", "regions": "region", "cases": "transition",
    "parameters": "declaration", "variables": "declaration", "outputs": "declaration",
    "emits": "attributes", "receives": "attributes", "with": "value", "pass": "value", "as": "value",
    "assign": "value",
}  # fmt: skip
"""Mappings with names as keys, which keep their order -> the kind of their values."""


def _short(node: Any, role: str = "plot") -> Any:
    """Return lists of one and mappings with only `to` or `type` in their short form, with keys in reading order."""
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
    """Return the key of a case as YAML writes its constant; other names unchanged."""
    value = case_value(name) if role == "cases" else name
    return name if isinstance(value, str) else value


def _rank(key: str) -> int:
    return _ORDER.index(key) if key in _ORDER else 0
