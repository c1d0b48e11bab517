"""The model after an edit, computed from the written form of the model instead of its text."""

from __future__ import annotations

import re
from copy import deepcopy
from typing import Any

from dsc.editing.surgery import Add, Move, Remove, RenameState, RenameVariable, Replace
from dsc.model.plot import ActionPlot
from dsc.text.plot_files import may_be_single

_NUMBERED = re.compile(r" \(\d+\)$")


def form_of(plot: ActionPlot) -> dict[str, Any]:
    """Return the written form without the names that tell equal rules apart, and without events that have no transition."""
    form = plot.to_form()
    for _, _, path in plot.walk():
        state = part(form, path)
        if "on" in state:
            state["on"] = {event: ways for event, ways in state["on"].items() if ways}
            if not state["on"]:
                del state["on"]
    for rule in (*form.get("rules", ()), *form.get("handlers", ())):
        if _NUMBERED.search(rule.get("name", "")):
            del rule["name"]
    return form


def meant(plot: ActionPlot, edit: Any) -> ActionPlot:
    """Return the model after an edit; raise ValueError or LookupError if there is none."""
    form = form_of(plot)
    match edit:
        case Add(path, value, before):
            insert(form, path, value, before)
        case Remove(path):
            take(form, path)
        case Replace(path, value):
            part(form, path[:-1])[path[-1]] = deepcopy(value)
        case Move(path, to, before):
            insert(form, to, take(form, path), before)
        case RenameState(path, new):
            form = rename_state(form, str(path[-1]), new)
        case RenameVariable(path, new):
            form = rename_variable(form, str(path[-1]), new)
    return ActionPlot.model_validate(form)


def part(form: Any, path: Any) -> Any:
    for key in path:
        form = form[key]
    return form


def take(form: Any, path: Any) -> Any:
    return part(form, path[:-1]).pop(path[-1])


def insert(form: Any, path: Any, value: Any, before: Any) -> None:
    for at in range(len(path) - 1):
        inside = part(form, path[:at])
        if isinstance(inside, dict) and path[at] not in inside:
            is_list = isinstance(path[at + 1], int)
            assert not is_list or may_be_single(path[: at + 1]) or path[at] in {"rules", "handlers", "dynamic"}
            inside[path[at]] = [] if is_list else {}
    around = part(form, path[:-1])
    if isinstance(around, list):
        if path[-1] > len(around):
            raise LookupError(path[-1])
        around.insert(path[-1], deepcopy(value))
        return
    items = [*around.items()]
    keys = [*around]
    if path[-1] in keys:
        raise ValueError(path[-1])
    items.insert(len(keys) if before is None else keys.index(before), (path[-1], deepcopy(value)))
    around.clear()
    around.update(items)


_TARGETS = {"to", "also", "initial", "then", "of", "before", "after"}
_NO_STATES = {
    "entry",
    "exit",
    "on_break",
    "command",
    "assign",
    "with",
    "pass",
    "parameters",
    "variables",
    "outputs",
    "listen",
    "types",
}


def rename_state(form: Any, old: str, new: str) -> Any:
    """Return the form with another name of a state; the keys around a text decide whether it is a state."""

    def walk(one: Any, key: str) -> Any:
        if isinstance(one, dict):
            renames = key in {"states", "connectors"}
            inner = "to" if key == "on" else None
            return {
                new if renames and name == old else name: value
                if name in _NO_STATES and not renames
                else walk(value, inner or name)
                for name, value in one.items()
            }
        if isinstance(one, list):
            return [walk(each, key) for each in one]
        if key == "clear" and one.removesuffix("*") == old:
            return one.replace(old, new)
        return new if key in _TARGETS and one == old else one

    form = walk(form, "")
    return texts(form, re.compile(rf"\(in-state {re.escape(old)}\)"), f"(in-state {new})")


def rename_variable(form: Any, old: str, new: str) -> Any:
    def walk(one: Any) -> Any:
        if isinstance(one, list):
            return [walk(each) for each in one]
        if not isinstance(one, dict):
            return one
        return {
            key: {new if name == old else name: walk(each) for name, each in value.items()}
            if key in {"assign", "bind", "bind_all"} and isinstance(value, dict)
            else walk(value)
            for key, value in one.items()
        }

    form = walk(form)
    for group in ("parameters", "variables", "outputs"):
        if group in form:
            form[group] = {new if name == old else name: one for name, one in form[group].items()}
    return texts(form, re.compile(rf"\?{re.escape(old)}(?![\w\-.])"), f"?{new}")


def texts(one: Any, pattern: re.Pattern[str], new: str) -> Any:
    """Return data with a replacement in all conditions, effects and terms, which begin with a bracket or `?`."""
    if isinstance(one, dict):
        return {key: value if key == "about" else texts(value, pattern, new) for key, value in one.items()}
    if isinstance(one, list):
        return [texts(each, pattern, new) for each in one]
    return pattern.sub(new, one) if isinstance(one, str) and one[:1] in {"(", "?"} else one
