"""Roles of the parts of a plot or profile, by their paths: the kind of names that are written there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

PLOT, PROFILE = "document", "profile"
"""The roles of whole documents."""

_WAY = {
    "to": "target",
    "also": "target",
    "do": "actions",
    "emit": "event",
    "when": "text",
    "tell": "text",
    "assign": "assigned",
    "bind": "assigned",
    "bind_all": "assigned",
    "clear": "history",
    "with": "values",
    "pass": "passed",
}
_INSIDE = {"states": "states", "initial": "target"}
_ROLES: Mapping[str, Mapping[str, str]] = {
    "document": {
        **_INSIDE, "plot": "name", "implements": "action", "parameters": "parameters", "variables": "variables",
        "outputs": "variables", "emits": "events", "receives": "events", "rules": "rules", "handlers": "rules",
        "types": "records", "offers": "offer",
        "robot": "robot",
    },
    "robot": {"sensors": "variables", "motors": "variables", "constants": "variables", "operations": "operations",
              "activities": "variables"},
    "operations": {"*": "assigned"},
    "states": {"*": "state"},
    "regions": {"*": "region"},
    "region": _INSIDE,
    "state": {
        **_INSIDE, "regions": "regions", "connectors": "states", "on": "on", "after": "timed", "every": "timed",
        "always": "ways", "choice": "ways", "cases": "cases", "else": "way", "use": "plot", "dynamic": "plots",
        "with": "arguments", "entry": "actions", "exit": "actions", "on_break": "actions", "emit": "event",
        "to": "target", "do": "actions",
    },
    "on": {"*": "ways"},
    "events": {"*": "attributes"},
    "records": {"*": "attributes"},
    "attributes": {"*": "type"},
    "plots": {"offers": "offer"},
    "cases": {"*": "way"},
    "ways": _WAY,
    "way": _WAY,
    "timed": _WAY,
    "actions": {"trigger": "skill", "emit": "event", "then": "actions", "else": "actions", "block": "actions",
                "assign": "assigned", "start": "variable", "stop": "variable", "into": "variable",
                "as": "renamed", "with": "values"},
    "renamed": {"*": "event"},
    "value": {"*": "value"},
    "values": {"*": "value"},
    "arguments": {"*": "value"},
    "assigned": {"*": "value"},
    "parameters": {"*": "declaration"},
    "variables": {"*": "declaration"},
    "declaration": {"type": "type", "default": "value", "initial": "value", "start": "assigned", "stop": "assigned"},
    "rules": {"on": "event", "of": "step", "before": "step", "after": "step", "do": "response", "listen": "actions"},
    "response": {"use": "plot", "with": "arguments", "pass": "passed", "then": "target", "on": "answers"},
    "passed": {"*": "value"},
    "answers": {"*": "target"},
    "profile": {"plots": "settings", "choose": "settings", "devices": "settings", "components": "components"},
    "settings": {"*": "values"},
    "components": {"*": "settings of a component"},
}  # fmt: skip


def role_of(document: str, path: Iterable[str | int]) -> str:
    """Return the role of the part at a path; empty for a part without names. Positions in lists keep the role.

    Args:
        document: `PLOT` or `PROFILE`.
        path: keys and positions, outermost first.
    """
    role = document
    for key in path:
        if isinstance(key, str):
            inside = _ROLES.get(role, {})
            role = inside.get(key) or inside.get("*", "")
    return role
